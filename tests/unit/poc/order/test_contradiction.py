"""The limit on listed contradictions."""

import numpy as np

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
    assert set(contradiction(order, seen, np.zeros(order.sensors)).chains) == pairs
    wide = CHAINS // 20
    assert wide > 40
    order, seen, _ = bipartite(wide)
    found = contradiction(order, seen, np.zeros(order.sensors))
    assert (len(found.chains), found.more) == (CHAINS, wide * wide - CHAINS)
    assert len(found.culprits) == wide
