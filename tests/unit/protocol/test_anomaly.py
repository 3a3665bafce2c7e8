"""A watcher tells what breaks what was believed, since when, and who is to blame."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot, Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.anomaly import MOST, AnomalyDetector, FoundAnomaly
from neurosnap.sensorium import Sensorium, complete
from tests.support.strategies import runs

NAMES = Sensorium(["a", "b", "c"])
CHAIN = PocGraph.from_implications(3, [(0, 2), (2, 4)])
FREE = PocGraph.from_implications(3, [])


def shown(
    watcher: AnomalyDetector, readings: list[tuple[int, ...]]
) -> list[FoundAnomaly | None]:
    return [watcher.watch(t, CHAIN, bits) for t, bits in enumerate(readings)]


def test_nothing_is_wrong_with_what_was_to_be_expected() -> None:
    assert (
        shown(AnomalyDetector(NAMES), [(0, 0, 0), (0, 0, 1), (0, 1, 1)]) == [None] * 3
    )


def test_what_is_renamed_is_told_by_its_new_name_and_goes_on() -> None:
    watcher = AnomalyDetector(Sensorium(["a", "grown 1", "c"]))
    shown(watcher, [(0, 0, 0), (1, 0, 1)])
    watcher.rename(NAMES)
    found = watcher.watch(2, CHAIN, (1, 0, 1))
    assert found is not None
    assert (found.since, found.broken[0].target) == (1, "b")


def test_an_anomaly_lasts_since_the_first_in_a_row() -> None:
    found = shown(
        AnomalyDetector(NAMES), [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (1, 0, 1)]
    )
    assert [None if one is None else one.since for one in found] == [
        *(None, 1, 1, None, 4)
    ]


def test_the_broken_implication_is_named_with_its_evidence() -> None:
    snapshot = EmpiricalSnapshot(NAMES, 0.25)
    for bits in [(0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1)]:
        snapshot.learn(bits)
    found = AnomalyDetector(NAMES).watch(
        4, snapshot.poc_graph(), (1, 0, 1), snapshot=snapshot
    )
    assert found is not None
    (broken,) = found.broken
    (link,) = broken.links
    assert (broken.source, broken.target) == (link.source, link.target) == ("a", "b")
    assert link.evidence == snapshot.evidence(0, 2)
    assert link.evidence.against == 0
    assert link.evidence.both == 1


def test_through_what_was_not_read_it_follows_from_several_links() -> None:
    snapshot = EmpiricalSnapshot(NAMES, 0.25)
    known = np.array([True, False, True])
    found = AnomalyDetector(NAMES).watch(0, CHAIN, (1, 0, 0), known, snapshot)
    assert found is not None
    (broken,) = found.broken
    assert [(one.source, one.target) for one in broken.links] == [
        ("a", "b"),
        ("b", "c"),
    ]
    assert (broken.source, broken.target) == ("a", "c")
    assert AnomalyDetector(NAMES).watch(0, CHAIN, (1, 0, 0), known & False) is None


def test_a_literal_never_on_has_no_evidence() -> None:
    never = PocGraph.from_implications(3, [(0, 1)])
    snapshot = EmpiricalSnapshot(NAMES, 0.25)
    found = AnomalyDetector(NAMES).watch(0, never, (1, 0, 0), snapshot=snapshot)
    assert found is not None
    assert found.broken[0].links[0].evidence is None
    assert found.culprits == ("a",)


def test_who_did_not_change_is_the_more_suspect() -> None:
    for before, culprit in (((1, 1, 1), "a"), ((0, 0, 1), "b")):
        _, found = shown(AnomalyDetector(NAMES), [before, (1, 0, 1)])
        assert found is not None
        assert found.culprits == (culprit,)
        assert found.candidates == ("a", "b")


def test_who_was_to_blame_before_is_again() -> None:
    # In the second a alone explains all; so it does in the third, where b might, too.
    _, second, third = shown(AnomalyDetector(NAMES), [(0, 0, 1), (1, 0, 0), (1, 0, 1)])
    assert second is not None
    assert third is not None
    assert second.candidates == second.culprits == third.culprits == ("a",)
    assert third.candidates == ("a", "b")


def test_blame_fades() -> None:
    watcher = AnomalyDetector(NAMES)
    shown(watcher, [(0, 0, 1), (1, 0, 0)])
    found = watcher.watch(10_000, CHAIN, (1, 0, 1))
    assert found is not None
    assert found.culprits == ("b",)


def test_it_holds_on_to_what_was_broken_first_for_a_while() -> None:
    watcher = AnomalyDetector(NAMES, hold=3)
    assert watcher.watch(0, CHAIN, (0, 1, 1)) is None
    first = watcher.watch(1, CHAIN, (1, 0, 1))
    # From now on the graph has unlearned everything.
    found = [watcher.watch(t, FREE, (1, 0, 1)) for t in (2, 4, 5)]
    assert watcher.watch(6, CHAIN, (1, 0, 1)) is not None
    assert [one and one.since for one in (first, *found)] == [1, 1, 1, None]


def test_an_anomaly_can_be_written_and_read() -> None:
    snapshot = EmpiricalSnapshot(NAMES, 0.25)
    found = AnomalyDetector(NAMES).watch(7, CHAIN, (1, 0, 0), snapshot=snapshot)
    assert found is not None
    again = msgspec.json.decode(msgspec.json.encode(found), type=FoundAnomaly)
    assert again == found


@pytest.mark.parametrize("sensors", [11, 12, 40])
def test_there_is_a_bound_to_what_it_lists(sensors: int) -> None:
    # One at a time, it says: all at once break one implication for each two of them.
    order = PocGraph.from_implications(
        sensors,
        [(2 * a, 2 * b + 1) for a in range(sensors) for b in range(a)],
    )
    found = AnomalyDetector(Sensorium.of(sensors)).watch(0, order, [True] * sensors)
    assert found is not None
    pairs = sensors * (sensors - 1) // 2
    assert len(found.broken) == min(pairs, MOST)
    assert len(found.broken) + found.more == pairs
    assert len({(one.source, one.target) for one in found.broken}) == len(found.broken)


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


def test_nonsense_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^hold: must be 0 or more, got -1$"):
        AnomalyDetector(NAMES, hold=-1)
    watcher = AnomalyDetector(NAMES)
    with pytest.raises(ShapeError, match=r"^graph: must have 3 sensors, got 0$"):
        watcher.watch(0, PocGraph(np.zeros((0, 0), np.bool_)), (0, 0, 0))
    with pytest.raises(
        ShapeError, match=r"^known: must hold 3 flags, one a sensor, got"
    ):
        watcher.watch(0, CHAIN, (0, 0, 0), np.ones(2, np.bool_))
    with pytest.raises(InvalidValueError, match=r"^known: must be bool, got"):
        watcher.watch(0, CHAIN, (0, 0, 0), np.ones(3))  # type: ignore[arg-type]
    watcher.watch(3, CHAIN, (0, 0, 0))
    with pytest.raises(InvalidValueError, match=r"^tick: must be above 3, got 3$"):
        watcher.watch(3, CHAIN, (0, 0, 0))


def test_what_rests_on_most_occasions_comes_first() -> None:
    names = Sensorium(["a", "b", "c"])
    snapshot, history = EmpiricalSnapshot(names, 0.25), History(3, 64)
    # a implies b from the first; c implies b, often.
    for bits in [(0, 0, 0), (1, 1, 0), *[(0, 1, 1), (0, 0, 0)] * 5, (0, 1, 0)]:
        snapshot.observe(bits)
        history.enter(np.array(bits, np.bool_))
    found = AnomalyDetector(names).watch(
        14, snapshot.poc_graph(), (1, 0, 1), None, snapshot, history
    )
    assert found is not None
    told = {
        (broken.source, broken.target): broken.links[0].occasions
        for broken in found.broken
    }
    assert told["a", "b"] == 1
    assert told["b*", "c*"] == 5
    assert list(told.values()) == sorted(told.values(), key=lambda held: -(held or 0))
