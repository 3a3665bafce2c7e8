"""Anomalies on the wire, and in words."""

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.protocol.anomaly import MOST, AnomalyDetector
from neurosnap.protocol.anomaly_messages import Link, announcement, told, with_support
from neurosnap.sensorium import Sensorium

NAMES = Sensorium(["door", "motion", "light"])


def broken() -> wire.Anomaly:
    """What is announced once the door opens without motion."""
    watcher, snapshot = AnomalyDetector(NAMES), EmpiricalSnapshot(NAMES, 0.25)
    for bits in [(0, 0, 1), (0, 1, 0), (1, 1, 1), (1, 1, 0)]:
        snapshot.observe(bits)
    found = watcher.watch(5, snapshot.poc_graph(), (1, 0, 1), None, snapshot)
    assert found is not None
    return announcement(found, NAMES)


def test_it_says_which_implication_breaks_and_what_speaks_for_it() -> None:
    said = told(broken(), NAMES.names)
    assert (said.tick, said.since, said.exact, said.more) == (5, 5, True, 0)
    assert said.broken == (Link("door -> motion", 2.0, 0.0, 3),)
    assert set(said.candidates) == {"door", "motion"}
    assert len(said.culprits) == 1


def test_there_is_a_bound_to_what_it_lists() -> None:
    count = 40
    names = Sensorium([f"s{k}" for k in range(count)])
    snapshot = EmpiricalSnapshot(names, 0.25)
    for k in range(60):  # one of them at a time, or none
        snapshot.observe(np.arange(count) == k)
    everything = np.ones(count, np.bool_)
    found = AnomalyDetector(names).watch(
        1, snapshot.poc_graph(), everything, None, snapshot
    )
    assert found is not None
    message = announcement(found, names)
    assert message.implications == count * (count - 1) // 2
    assert len(message.sources) == MOST
    assert told(message, names.names).more == message.implications - MOST


@pytest.mark.parametrize(
    "changes",
    [
        {"culprits": (3,)},
        {"candidates": (9,)},
        {"sources": (6,)},
        {"targets": (7,)},
        {"support": ()},
        {"number": (0, 0)},
    ],
)
def test_one_that_cannot_be_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(MessageError, match="anomaly: must"):
        told(msgspec.structs.replace(broken(), **changes), NAMES.names)


def rests_on(*occasions: int) -> wire.Anomaly:
    """Return an anomaly: the door implies the motion, which implies the light by it.

    The first broken implication has two links, the second one.
    """
    return wire.Anomaly(
        tick=9,
        since=9,
        culprits=(0, 2),
        candidates=(0, 1, 2),
        exact=True,
        implications=70,
        number=(0, 0, 1),
        sources=(0, 2, 4),
        targets=(2, 1, 3),
        support=(1.0, 2.0, 3.0),
        against=(0.0, 0.0, 0.0),
        learned=(1, 2, 3),
        occasions=occasions,
    )


def test_what_rests_on_its_weakest_link_is_told_with_support_alone() -> None:
    anomaly = rests_on(9, 4, 5)
    assert with_support(anomaly, 4) == anomaly
    rest = with_support(anomaly, 5)
    assert rest is not None
    assert (rest.number, rest.sources, rest.occasions) == ((1,), (4,), (5,))
    assert (rest.culprits, rest.candidates, rest.implications) == ((2,), (1, 2), 1)
    (link,) = told(rest, NAMES.names).broken
    assert (link.implication, link.occasions) == ("light -> motion*", 5)
    assert with_support(anomaly, 6) is None


def test_nothing_is_left_out_where_no_occasions_were_counted() -> None:
    assert with_support(rests_on(), 99) == rests_on()
    assert with_support(rests_on(0, 0, 0), 0) == rests_on(0, 0, 0)


def test_occasions_that_are_not_one_a_link_are_refused() -> None:
    with pytest.raises(MessageError, match="an entry a link"):
        with_support(rests_on(1, 2), 1)


def test_without_occasions_it_is_on_the_wire_as_it_was() -> None:
    assert b"occasions" not in wire.encode(rests_on())
    assert b'"occasions":[1,2,3]' in wire.encode(rests_on(1, 2, 3))
