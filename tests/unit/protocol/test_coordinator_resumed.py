"""A core restored from a key-frame behaves as the original."""

import random
from collections.abc import Sequence

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions, SnapshotKind
from tests.support.swarm_parts import AnsweringSwarm, observation

SENSORS = ("a", "b", "c", "d")
TICKS = 40
EVERY = 10


def options(workers: int, snapshot: SnapshotKind, **more: object) -> RunOptions:
    given: dict[str, object] = {
        "source": "none",
        "body": Body(own=SENSORS, actions=("go", "stay")),
        "ticks": TICKS,
        "seed": 3,
        "snapshot": snapshot,
        "threshold": 0.08 if snapshot == "empirical" else 0.15,
        "decay": None if snapshot == "empirical" else 0.9,
        "cells": "worker" if workers else "process",
        "workers": max(workers, 1),
        "keyframe_every": EVERY,
        "watch": True,
        "support": 3,
    }
    return RunOptions(**(given | more))  # type: ignore[arg-type]


def rows() -> list[list[bool | None]]:
    """Readings, some of them unknown, with exceptions to what is learned."""
    chance = random.Random(5)
    found = []
    for tick in range(TICKS):
        a, b, d = (chance.random() < 0.5 for _ in range(3))
        row = [a, b, (a or b) != (tick % 13 == 12), d]
        known = [chance.random() < 0.9 for _ in range(3)] + [True]
        found.append([x if k else None for x, k in zip(row, known, strict=True)])
    return found


ROWS = rows()


def swarm_of(given: RunOptions, frame: wire.KeyFrame | None = None) -> AnsweringSwarm:
    if frame is None:
        core = Coordinator(given)
    else:
        core = Coordinator.from_key_frame(given, frame)
    return AnsweringSwarm(core, len(SENSORS), given.sharing)


def run(swarm: AnsweringSwarm, first: list[wire.Message]) -> list[wire.Message]:
    """Show the rows until it asks for nothing more; return what its core says."""
    new = said = swarm.say(first)
    while decisions := [m for m in new if isinstance(m, wire.Decision)]:
        (decision,) = decisions
        if decision.tick == TICKS:
            break
        tick = decision.tick + 1
        shown = observation(tick, ROWS[decision.tick])
        new = swarm.say([shown])
        said = said + new
    return said


def payloads(messages: Sequence[wire.Message]) -> list[bytes]:
    return [wire.encode(message) for message in messages]


@pytest.mark.parametrize("snapshot", ["empirical", "discounted"])
@pytest.mark.parametrize("workers", [0, 1, 2])
def test_a_core_made_of_a_key_frame_goes_on_byte_for_byte(
    workers: int, snapshot: SnapshotKind
) -> None:
    given = options(workers, snapshot)
    swarm = swarm_of(given)
    said = run(swarm, swarm.core.begin())
    assert swarm.core.tick == TICKS
    assert any(isinstance(message, wire.Anomaly) for message in said)
    places = [
        place
        for place, message in enumerate(said)
        if isinstance(message, wire.KeyFrame)
    ]
    assert len(places) == TICKS // EVERY
    for place in places:
        frame = said[place]
        assert isinstance(frame, wire.KeyFrame)
        again = swarm_of(given, frame)
        again.core.resume(TICKS)
        # It says it again: that is where whoever goes on starts from.
        rest = run(again, again.core.begin() if frame.tick < TICKS else [frame])
        assert payloads(rest) == payloads(said[place:])
        assert again.core.totals == swarm.core.totals


def test_a_key_frame_of_another_run_is_refused() -> None:
    given = options(2, "empirical")
    core = Coordinator(given)
    frame = wire.KeyFrame(5, core.snapshot.to_bytes(), waves=9, epochs=(1, 2, 3))
    with pytest.raises(InvalidValueError, match=r"^epochs: must be one for each of 2"):
        Coordinator.from_key_frame(given, frame)
    with pytest.raises(InvalidValueError, match=r"^data: must be a Snapshot written"):
        Coordinator.from_key_frame(
            given, msgspec.structs.replace(frame, snapshot=b"none")
        )
