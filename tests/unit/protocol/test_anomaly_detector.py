"""A detector finds observations that contradict the model, and names suspects."""

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.anomaly_detector import MOST, AnomalyDetector
from neurosnap.protocol.anomaly_report import broken_rule
from neurosnap.sensorium import complete
from tests.support.strategies import runs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from neurosnap.poc.learning.snapshot import Snapshot

CHAIN = PocGraph.from_implications(3, [(0, 2), (2, 4)])
FREE = PocGraph.from_implications(3, [])
FREE4 = PocGraph.from_implications(4, [])


def read(*bits: int) -> "NDArray[np.bool_]":
    return np.array(bits, np.bool_)


def found_in(*readings: tuple[int, ...]) -> list[wire.Anomaly | None]:
    detector = AnomalyDetector(3)
    return [detector.watch(t, CHAIN, read(*bits)) for t, bits in enumerate(readings)]


def links(found: wire.Anomaly) -> list[tuple[int, int]]:
    return [(one.source, one.target) for one in found.links]


def test_a_rule_about_the_first_culprit_is_listed_among_many() -> None:
    first, hub = MOST + 1, MOST + 3
    rules = [(2 * each, 2 * hub) for each in range(first)]
    graph = PocGraph.from_implications(hub + 1, [*rules, (2 * first, 2 * first + 2)])
    bits = np.ones(hub + 1, np.bool_)
    bits[[first + 1, hub]] = False
    found = AnomalyDetector(hub + 1).watch(1, graph, bits)
    assert found is not None
    assert found.culprits == (first + 1, hub)
    rule = broken_rule(found)
    assert rule is not None
    assert (rule.source, rule.target) == (2 * first, 2 * first + 2)
    assert len({link.number for link in found.links}) == MOST


def test_an_anomaly_lasts_since_the_first_in_a_row() -> None:
    found = found_in((0, 0, 0), (0, 1, 1), (1, 0, 0), (1, 0, 1), (0, 0, 1), (1, 0, 1))
    assert [one and one.since for one in found] == [None, None, 2, 2, None, 5]


def test_the_broken_implication_comes_with_its_evidence() -> None:
    snapshot = EmpiricalSnapshot(3, 0.25)
    for bits in [(0, 0, 1), (0, 1, 0), (1, 1, 1), (1, 1, 0)]:
        snapshot.learn(bits)
    graph = snapshot.poc_graph()
    found = AnomalyDetector(3).watch(5, graph, read(1, 0, 1), snapshot=snapshot)
    evidence = snapshot.evidence(0, 2)
    assert found is not None
    weights = evidence.both, evidence.against, evidence.since
    assert found.links == (wire.WeighedLink(0, 0, 2, *weights),)
    assert found.implications == 1
    assert ({*found.candidates}, len(found.culprits)) == ({0, 1}, 1)
    assert found.exact


def test_through_what_was_not_read_it_follows_from_several_links() -> None:
    snapshot = EmpiricalSnapshot(3, 0.25)
    known = np.array([True, False, True])
    found = AnomalyDetector(3).watch(0, CHAIN, read(1, 0, 0), known, snapshot)
    assert found is not None
    assert links(found) == [(0, 2), (2, 4)]
    assert {one.number for one in found.links} == {0}
    assert AnomalyDetector(3).watch(0, CHAIN, read(1, 0, 0), known & False) is None


def test_a_literal_never_on_has_no_evidence() -> None:
    never, snapshot = (
        PocGraph.from_implications(3, [(0, 1)]),
        EmpiricalSnapshot(3, 0.25),
    )
    found = AnomalyDetector(3).watch(0, never, read(1, 0, 0), snapshot=snapshot)
    assert found is not None
    assert (found.links, found.culprits) == ((wire.WeighedLink(0, 0, 1),), (0,))


@pytest.mark.parametrize(
    ("before", "culprit"),
    [
        ([(1, 1, 1)], 0),  # what did not change is the more suspect
        ([(0, 0, 1)], 1),
        ([(0, 0, 1), (1, 0, 0)], 0),  # and what was to blame before
    ],
)
def test_the_likeliest_of_several_is_the_culprit(
    before: list[tuple[int, ...]], culprit: int
) -> None:
    *_, found = found_in(*before, (1, 0, 1))
    assert found is not None
    assert (found.culprits, found.candidates) == ((culprit,), (culprit, 1 - culprit))


def test_of_two_it_is_the_one_that_others_do_not_bear_out() -> None:
    detector = AnomalyDetector(4, support=1)
    # All but the last go together, and the last says nothing.
    for tick in range(40):
        detector.watch(tick, FREE4, read(*[tick % 2] * 3, tick % 3 == 0))
    rule = PocGraph.from_implications(4, [(0, 2)])
    for bits, culprit in ((1, 0, 1, 1), 1), ((1, 0, 0, 1), 0):
        found = detector.watch(40, rule, read(*bits))
        assert found is not None
        assert found.candidates == (culprit, 1 - culprit)


def test_blame_fades() -> None:
    detector = AnomalyDetector(3)
    for tick, bits in ((0, (0, 0, 1)), (1, (1, 0, 0))):
        detector.watch(tick, CHAIN, read(*bits))
    found = detector.watch(10_000, CHAIN, read(1, 0, 1))
    assert found is not None
    assert found.culprits == (1,)


def test_it_holds_on_to_what_was_broken_first_for_a_while() -> None:
    detector = AnomalyDetector(3, hold=3)
    assert detector.watch(0, CHAIN, read(0, 1, 1)) is None
    first = detector.watch(1, CHAIN, read(1, 0, 1))
    # From now on the graph has unlearned everything.
    found = [detector.watch(t, FREE, read(1, 0, 1)) for t in (2, 4, 5)]
    assert detector.watch(6, CHAIN, read(1, 0, 1)) is not None
    assert [one and one.since for one in (first, *found)] == [1, 1, 1, None]


@pytest.mark.parametrize("sensors", [11, 12, 40])
def test_there_is_a_bound_to_what_it_lists(sensors: int) -> None:
    # One at a time, it says: all at once break one implication for each two of them.
    order = PocGraph.from_implications(
        sensors, [(2 * a, 2 * b + 1) for a in range(sensors) for b in range(a)]
    )
    found = AnomalyDetector(sensors).watch(0, order, np.ones(sensors, np.bool_))
    assert found is not None
    pairs = sensors * (sensors - 1) // 2
    assert found.implications == pairs
    numbers = {one.number for one in found.links}
    assert len(set(links(found))) == len(numbers) == min(pairs, MOST)


@given(runs(), st.sampled_from([0.25, 1 / 8000]), st.booleans())
def test_where_one_exception_convinces_nothing_is_wrong_once_it_is_learned(
    run: tuple[int, list[list[bool]]], threshold: float, discounted: bool
) -> None:
    sensors, observations = run
    snapshot: Snapshot
    if discounted:
        snapshot = DiscountedSnapshot(sensors, threshold, 1 - threshold)
    else:
        snapshot = EmpiricalSnapshot(sensors, threshold)
    for bits in observations:
        snapshot.learn(bits)
        if discounted or threshold * snapshot.clock <= 1:
            read = complete(np.array(bits, np.bool_))
            assert snapshot.poc_graph().is_coherent(read)


def test_what_rests_on_most_occasions_comes_first() -> None:
    snapshot, detector = EmpiricalSnapshot(3, 0.25), AnomalyDetector(3, support=1)
    # 0 implies 1 from the first; 2 implies 1, often.
    shown = [(0, 0, 0), (1, 1, 0), *[(0, 1, 1), (0, 0, 0)] * 5, (0, 1, 0)]
    for tick, bits in enumerate(shown):
        detector.watch(tick, snapshot.poc_graph(), read(*bits))
        snapshot.observe(bits)
    found = detector.watch(14, snapshot.poc_graph(), read(1, 0, 1), None, snapshot)
    assert found is not None
    occasions = {(one.source, one.target): one.occasions for one in found.links}
    assert (occasions[0, 2], occasions[3, 5]) == (1, 5)
    assert list(occasions.values()) == sorted(occasions.values(), reverse=True)
