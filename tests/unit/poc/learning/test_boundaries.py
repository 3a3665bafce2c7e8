"""The observation at which the relation of two sensors changes, counted by hand."""

import numpy as np
import pytest

from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.reading_history import Newborn

A, B, C = 0, 2, 4
"""The literals that say that the sensors are on."""


@pytest.mark.parametrize("idle", [0, 64], ids="{} sensors are idle".format)
def test_a_limit_that_grows_past_the_exceptions_counts_at_once(idle: int) -> None:
    """At tick 63, where the row looks ahead, a was 7 times without b; tau t is 6.3.

    Nothing speaks against it any more. At 71 the limit is 7.1, and a implies b. Where
    the row has many idle pairs, this one is judged from a list meanwhile.
    """
    rows = [(1, 0)] * 7 + [(1, 1), (0, 0), (0, 1), (1, 1)] * 14
    snapshot = EmpiricalSnapshot(2 + idle, threshold=0.1)
    a, b = (A, B) if not idle else (2 * (1 + idle), A)
    implied = []
    for number in range(90):
        on, also = rows[number] if number < len(rows) else (1, 1)
        row = (on, also) if not idle else (also, *[0] * idle, on)
        snapshot.observe(np.array(row, np.bool_))
        implied.append(bool(snapshot.poc_graph().up([a])[b]))
    assert [tick for tick, holds in enumerate(implied, 1) if holds] == [*range(71, 91)]


def test_a_newborn_is_judged_by_its_own_age() -> None:
    """It was read at 2 of the 100 ticks before. At two more it reads what `a` does.

    Its pairs are judged once half of its age was read: of 3 ticks 1 is not enough, of
    4 ticks 2 are. By the age of the others it would take 51 ticks.
    """
    snapshot = EmpiricalSnapshot(3, threshold=0.1)
    known = np.array([True, True, False])
    for number in range(100):
        row = np.array([number % 2, number % 3 == 0, False], np.bool_)
        snapshot.observe(row, known)
    nothing = Newborn(2, np.zeros((4, 2), np.uint32), np.zeros(2, np.uint8))
    snapshot.grow(2, "c", nothing, None)
    implied = []
    for on in (True, False, True):
        snapshot.observe([on, True, on], [True, False, True])
        implied.append(bool(snapshot.poc_graph().up([C])[A]))
    assert implied == [False, True, True]
