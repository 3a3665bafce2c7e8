"""The limit on listed contradictions, and invalid input."""

import re

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.contradiction import CHAINS, contradiction
from neurosnap.poc.order.graph import PocGraph


def bipartite(wide: int) -> tuple[PocGraph, list[int], set[tuple[int, int]]]:
    """Return an order, a reading that breaks each implication in it, and those."""
    lows, highs = range(0, 2 * wide, 2), range(2 * wide, 4 * wide, 2)
    pairs = [(a, b) for a in lows for b in highs]
    order = PocGraph.from_implications(2 * wide, pairs)
    return order, [*lows, *(b + 1 for b in highs)], set(pairs)


def test_many_broken_implications_are_counted_and_not_all_listed() -> None:
    order, seen, pairs = bipartite(20)
    assert set(contradiction(order, seen).chains) == pairs
    wide = CHAINS // 20
    assert wide > 40
    order, seen, _ = bipartite(wide)
    found = contradiction(order, seen)
    assert (len(found.chains), found.more) == (CHAINS, wide * wide - CHAINS)
    assert len(found.culprits) == wide


@pytest.mark.parametrize(
    ("seen", "suspicion", "error"),
    [
        ([0, 1], None, "observed: must not hold a literal and its complement, got 0"),
        ([8], None, "observed: must be a literal, a whole number in [0, 8), got 8"),
        ([0], [0, 0, np.nan, 0], "suspicion: must be finite, got nan"),
        ([0], [1, 2, 3], "suspicion: must be (4,), got (3,)"),
    ],
)
def test_nonsense_is_refused(
    seen: list[int], suspicion: list[float] | None, error: str
) -> None:
    chain = PocGraph.from_implications(4, [(0, 2), (2, 4), (4, 6)])
    with pytest.raises(InvalidValueError, match=f"^{re.escape(error)}$"):
        contradiction(chain, seen, suspicion)
