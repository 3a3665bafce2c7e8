"""How long a discounted snapshot takes to learn, against one that does.

The paper takes ``w_ab*`` by itself ([GK] discounted:formalism). With ``w_ab* = 1`` at
first, no implication ``b -> a`` on record meanwhile and the other weights above the
threshold in time, `to_learn` is exact. While ``b -> a`` is on record, each truncation
takes what it takes from ``w_a*b`` from ``w_ab*`` too, and the wait may be shorter than
the paper's ``log tau / log q``.

The square here is of sensors 0 and 1, literals ``a = 0`` and ``b = 2``.
"""

import itertools
import math

import numpy as np
import pytest

from neurosnap.poc.learning.kinds import DiscountedSnapshot
from tools.paper.fig2_discounted import to_learn

A, B = 0, 2
BOTH, ONLY_A, ONLY_B, NEITHER = (1, 1), (1, 0), (0, 1), (0, 0)
SCHEDULE = (BOTH, NEITHER, ONLY_B)

GRID = [(1 - 2.0**-k, tau) for k in (1, 2, 5, 9) for tau in (1 / 8000, 0.01, 0.25)]


def square(
    decay: float, tau: float, both: float, only_a: float, only_b: float, code: int
) -> DiscountedSnapshot:
    """A snapshot with these weights, the rest without `a` and `b`."""
    arrays = DiscountedSnapshot(2, tau, decay).arrays()
    return DiscountedSnapshot.from_arrays(
        arrays
        | {
            "clock": np.array(1),
            "joints": np.array([both]),
            "marginals": np.array([both + only_a, both + only_b]),
            "codes": np.array([code], np.uint8),
        }
    )


def largest(decay: float, tau: float) -> DiscountedSnapshot:
    """The square with ``w_ab* = 1``: in it ``a`` and ``b*`` are equivalent."""
    snapshot = square(decay, tau, 0.0, 1.0, 0.0, code=12)
    assert snapshot.weight(A, B ^ 1) == 1
    return snapshot


def has(snapshot: DiscountedSnapshot, a: int, b: int) -> bool:
    return bool(snapshot.poc_graph(equivalences=False).edges[a, b])


def quiet(decay: float, tau: float) -> bool:
    """Whether each of `SCHEDULE` keeps its weight above tau: nothing is truncated."""
    return decay**2 * (1 - decay) >= tau


@pytest.mark.parametrize(("decay", "tau"), [g for g in GRID if quiet(*g)])
def test_an_implication_is_learned_after_exactly_so_many_observations(
    decay: float, tau: float
) -> None:
    """The paper's ``log tau / log q`` is needed, and the next whole number enough."""
    snapshot = largest(decay, tau)
    expected = to_learn(tau, decay)
    for count, bits in enumerate(itertools.cycle(SCHEDULE), 1):
        snapshot.learn(bits)
        assert snapshot.weight(A, B ^ 1) == pytest.approx(
            decay**count if count < expected else 0, abs=1e-12
        )
        assert has(snapshot, A, B) == (count == expected)
        if count == expected:
            break
    assert expected - 1 <= math.log(tau) / math.log(decay) < expected
