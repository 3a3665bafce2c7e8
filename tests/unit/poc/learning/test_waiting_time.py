"""Learning time of a discounted snapshot, compared with an empirical one.

The paper takes ``w_ab*`` by itself ([GK] discounted:formalism). With ``w_ab* = 1`` at
first, no implication ``b -> a`` on record meanwhile and the other weights above the
threshold in time, `to_learn` is exact. While ``b -> a`` is on record, each truncation
takes what it takes from ``w_a*b`` from ``w_ab*`` too, and the wait may be shorter than
the paper's ``log tau / log q``.
"""

import math

import numpy as np
import pytest

from neurosnap.poc.learning.discounted import DiscountedSnapshot
from tests.support.edges import learned_edges
from tools.paper.fig2_discounted import to_learn

BOTH, ONLY_B, NEITHER = (1, 1), (0, 1), (0, 0)
GRID = [(1 - 2.0**-k, tau) for k in (1, 2, 5, 9) for tau in (1 / 8000, 0.01, 0.25)]


@pytest.mark.parametrize(
    ("decay", "tau"),
    # Each observation keeps its weight above tau until the next such one.
    [(decay, tau) for decay, tau in GRID if decay**2 * (1 - decay) >= tau],
)
def test_an_implication_is_learned_after_exactly_so_many_observations(
    decay: float, tau: float
) -> None:
    """The paper's ``log tau / log q`` is needed, and the next whole number enough."""
    arrays = DiscountedSnapshot(2, tau, decay).arrays() | {
        "clock": np.array(1),
        "joints": np.array([0.0]),
        "marginals": np.array([1.0, 0.0]),
        "codes": np.array([12], np.uint8),  # a and b* are equivalent
    }
    snapshot = DiscountedSnapshot.from_arrays(arrays)
    assert snapshot.weight(0, 3) == 1
    expected = to_learn(tau, decay)
    for count in range(1, expected + 1):
        snapshot.learn((ONLY_B, BOTH, NEITHER)[count % 3])
        assert snapshot.weight(0, 3) == pytest.approx(
            decay**count if count < expected else 0, abs=1e-12
        )
        edges = learned_edges(snapshot, equivalences=False)
        assert ((0, 2) in edges) == (count == expected)
    assert expected - 1 <= math.log(tau) / math.log(decay) < expected
