"""Small contradictions known by heart, and what is refused."""

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.contradiction import CHAINS, contradiction
from neurosnap.poc.order.graph import PocGraph

CHAIN = PocGraph.from_implications(4, [(0, 2), (2, 4), (4, 6)])


def test_what_goes_with_the_order_is_no_contradiction() -> None:
    found = contradiction(CHAIN, [1, 3, 4, 6])
    assert found.coherent
    assert not found.chains
    assert not found.culprits + found.candidates
    assert contradiction(CHAIN, []).coherent
    assert contradiction(PocGraph(np.zeros((0, 0), np.bool_)), []).coherent


def test_one_sensor_stuck_on_is_the_one_to_blame() -> None:
    found = contradiction(CHAIN, [0, 3, 5, 7])
    assert found.chains == ((0, 2),)
    assert found.culprits == found.candidates == (0,)


def test_between_two_alike_suspicion_decides_and_then_their_order() -> None:
    seen = [0, 3, 4, 6]
    assert contradiction(CHAIN, seen).culprits == (0,)
    assert contradiction(CHAIN, seen, [0, 0.5, 0, 9]).culprits == (1,)
    assert contradiction(CHAIN, seen, [0, 0.5, 0, 9]).candidates == (0, 1)


def test_a_chain_leads_through_what_was_not_read() -> None:
    found = contradiction(CHAIN, [0, 7])
    assert found.chains == ((0, 2, 4, 6),)
    assert found.candidates == (0, 3)


def test_a_literal_that_is_never_on_is_to_blame_by_itself() -> None:
    never = PocGraph.from_implications(3, [(0, 2), (0, 3), (4, 0)])
    found = contradiction(never, [0, 2])
    assert found.chains == ((0, 3),)
    assert found.culprits == found.candidates == (0,)
    alone = contradiction(never, [4])
    assert alone.culprits == (2,)
    assert (alone.chains[0][0], alone.chains[0][-1]) == (4, 5)


def test_equivalent_sensors_that_differ_break_what_binds_them() -> None:
    equal = PocGraph.from_implications(3, [(0, 2), (2, 0), (2, 4), (4, 2)])
    found = contradiction(equal, [0, 3, 5])
    assert found.chains == ((0, 2), (0, 4))
    assert found.culprits == (0,)


def test_many_broken_implications_are_counted_and_not_all_listed() -> None:
    count = 40
    lows, highs = range(0, count, 2), range(count, 2 * count, 2)
    order = PocGraph.from_implications(count, [(a, b) for a in lows for b in highs])
    seen = [*lows, *(b + 1 for b in highs)]
    pairs = {(a, b) for a in lows for b in highs}
    assert set(contradiction(order, seen).chains) == pairs
    wide = 2 * CHAINS // count
    assert wide > count
    count = 2 * wide
    lows, highs = range(0, count, 2), range(count, 2 * count, 2)
    order = PocGraph.from_implications(count, [(a, b) for a in lows for b in highs])
    seen = [*lows, *(b + 1 for b in highs)]
    found = contradiction(order, seen)
    assert (len(found.chains), found.more) == (CHAINS, wide * wide - CHAINS)
    assert len(found.culprits) == wide


@pytest.mark.parametrize(
    ("seen", "suspicion", "error"),
    [
        (
            [0, 1],
            None,
            r"^observed: must not hold a literal and its complement, got 0$",
        ),
        (
            [8],
            None,
            r"^observed: must be a literal, a whole number in \[0, 8\), got 8$",
        ),
        ([0], [0, 0, np.nan, 0], r"^suspicion: must be finite, got nan$"),
    ],
)
def test_nonsense_is_refused(
    seen: list[int], suspicion: list[float] | None, error: str
) -> None:
    with pytest.raises(InvalidValueError, match=error):
        contradiction(CHAIN, seen, suspicion)


def test_a_suspicion_is_of_every_sensor() -> None:
    with pytest.raises(ShapeError, match=r"^suspicion: must be \(4,\), got \(3,\)$"):
        contradiction(CHAIN, [0], [1, 2, 3])
