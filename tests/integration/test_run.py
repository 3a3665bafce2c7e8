"""Swarms compute the same in processes, in workers and inline, and what is right."""

import random
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions, SnapshotKind
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.replay import Replay
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.sensorium import unpack
from tests.support import replayed_runs
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.inline_runs import recorded_run, spread
from tests.support.played_runs import (
    GRID,
    PATH,
    SEED,
    TICKS,
    Played,
    options_for,
    play,
    write_readings,
)
from tests.support.recorded_messages import of_type
from tests.support.rewritten_recordings import changing, rewritten

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_readings(tmp_path_factory.mktemp("run") / "readings.csv", TICKS)


# What comes out -----------------------------------------------------------------------

INLINE: list[dict[str, object]] = [{"cells": "inline"}, {"wiring": "derived"}]
PROCESSES: list[dict[str, object]] = [
    {"cells": "process"},
    {"cells": "process", "wiring": "derived"},
]
WORKERS: list[dict[str, object]] = [
    {"cells": "worker", "workers": workers} for workers in (1, 2, 4)
]


@pytest.mark.zenoh
@pytest.mark.parametrize(
    ("source", "agent", "snapshot", "ways"),
    rows(
        [
            ("csv", "walker", "empirical", [*INLINE, *PROCESSES, *WORKERS[:2]]),
            (PATH, "walker", "discounted", INLINE),
            (GRID, "planner", "empirical", [INLINE[0], WORKERS[2]]),
        ],
        [
            ("csv", "walker", "discounted", INLINE),
            (PATH, "walker", "empirical", [*INLINE, *PROCESSES, *WORKERS]),
            (GRID, "planner", "empirical", [*INLINE, *PROCESSES, *WORKERS]),
        ],
    ),
)
async def test_every_kind_of_cells_comes_to_the_same_and_to_what_is_right(
    source: str,
    agent: AgentKind,
    snapshot: SnapshotKind,
    ways: list[dict[str, object]],
    readings: str,
    tmp_path: Path,
) -> None:
    first: Played | None = None
    for number, way in enumerate(ways):
        options = options_for(
            readings if source == "csv" else source,
            agent=agent,
            snapshot=snapshot,
            **way,  # type: ignore[arg-type]
        )
        played = await play(options, tmp_path / f"{number}.mcap")
        assert played.recording.completeness().whole
        literals = 2 * len(options.sensors)
        states = [unpack(s.literals, literals).tolist() for s in played.of(wire.State)]
        assert len(states) == TICKS
        assert states == expected_states(played, options)
        verdict = verify(tmp_path / f"{number}.mcap")
        assert (verdict.same, verdict.complete) == (True, True), verdict.difference
        first = first or played
        assert played.states == first.states
        # Planning waves of one tick may settle in any order.
        assert sorted(played.reached) == sorted(first.reached)
        assert played.decisions == first.decisions
        if options.wiring == "hasse":
            # Even the pulses are as many: every literal above the signal fires, once.
            assert played.pulses == first.pulses
    assert first is not None
    assert any(state.height > 0 for state in first.of(wire.State))
    if (source, snapshot) == ("csv", "empirical"):
        assert any(incoherent for _, _, incoherent in first.states)
    assert bool(first.reached) or agent == "walker"


def expected_states(played: Played, options: RunOptions) -> list[list[bool]]:
    """Return what the snapshot says by itself of what was observed."""
    snapshot = options.new_snapshot()
    observed = played.of(wire.Observation)
    sensors = len(options.sensors)
    return [snapshot.observe(unpack(o.bits, sensors)).tolist() for o in observed]


TOPICS = (
    "observation",
    "wiring",
    "wavestart",
    "state",
    "reached",
    "decision",
    "keyframe",
)
WORKER_TOPICS = (*TOPICS, "workerwiring", "pulsebatch", "workerreport")


@pytest.mark.parametrize(
    ("source", "given", "topics"),
    [
        ("csv", {}, TOPICS),
        (PATH, {}, TOPICS),
        (
            GRID,
            {"cells": "worker", "workers": 3, "agent": "planner"},
            WORKER_TOPICS,
        ),
    ],
)
def test_the_same_seed_gives_the_same_recording(
    source: str,
    given: Mapping[str, object],
    topics: tuple[str, ...],
    readings: str,
    tmp_path: Path,
) -> None:
    options = options_for(readings if source == "csv" else source, **given)  # type: ignore[arg-type]
    other = msgspec.structs.replace(options, seed=SEED + 1)
    found = []
    for number, each in enumerate((options, options, other)):
        recorded_run(each, log := tmp_path / f"{number}.mcap")
        found.append(Played(log))
    first, second, third = (one.payloads(*topics) for one in found)
    assert first == second
    assert found[0].recording.completeness().whole
    assert (found[0].states == found[2].states) == (source == "csv")
    assert first != third
    if given:
        assert any(b'"type":"pulsebatch"' in payload for payload in first)


def depths(log: Path) -> Iterator[tuple[int, int]]:
    """Yield the depth of each planning wave, and of the shortest ways it could take."""
    results: dict[int, list[wire.Reached]] = {}
    for result in of_type(log, wire.Reached):
        results.setdefault(result.tick, []).append(result)
    replay = Replay(Recording.open(log))
    for tick in replay.ticks():
        for result in results.get(tick, []):
            yield result.depth, replay.core.graph.depth(result.signal)


def test_waves_in_one_worker_take_the_shortest_ways(tmp_path: Path) -> None:
    # In one worker nothing is left to chance. Among more, or among processes, which way
    # a wave first comes depends on what is faster at that time.
    found: dict[int, list[tuple[int, int]]] = {}
    for workers in (1, 3):
        options = options_for(GRID, agent="planner", cells="worker", workers=workers)
        recorded_run(options, log := tmp_path / f"{workers}.mcap")
        found[workers] = sorted(depths(log))
    assert all(depth == shortest for depth, shortest in found[1])
    assert all(depth >= shortest for depth, shortest in found[3])
    assert max(depth for depth, _ in found[1]) > 2


# A recording of workers ---------------------------------------------------------------


@pytest.fixture(scope="module")
def log(readings: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("workers") / "log.mcap"
    recorded_run(options_for(readings, cells="worker", workers=3), path)
    return path


@pytest.mark.parametrize(
    ("kind", "found", "to"),
    [
        (
            wire.WorkerReport,
            lambda m: m.wave > 20 and m.literals,
            lambda m: {"literals": m.literals[4:], "hops": m.hops[4:]},
        ),
        (wire.WorkerWiring, lambda m: m.add, lambda m: {"add": m.add[8:]}),
    ],
)
def test_what_a_worker_leaves_out_is_found(
    kind: type[wire.Message],
    found: Callable[[wire.Message], bool],
    to: Callable[[wire.Message], dict[str, object]],
    log: Path,
    tmp_path: Path,
) -> None:
    verdict = verify(rewritten(log, tmp_path / "changed", changing(kind, found, to)))
    assert not verdict.same
    assert verdict.difference is not None


def test_a_run_of_workers_goes_on_where_it_ended(tmp_path: Path) -> None:
    options = options_for(GRID, agent="planner", cells="worker", workers=2)
    whole, first, rest = (tmp_path / f"{name}.mcap" for name in ("whole", "a", "b"))
    recorded_run(options, whole)
    recorded_run(options, first, stop_at=8)
    again, past = find_resume_point(first)
    assert 8 <= past.tick < TICKS
    assert again == options
    assert {"worker/0", "worker/1"} <= past.counts.keys()
    recorded_run(again, rest, past=past)
    verdict = verify(rest)
    assert (verdict.same, verdict.complete) == (True, True), verdict.difference
    assert course(rest) == course(whole)


# Workers that share the learning ------------------------------------------------------


def random_source(chance: random.Random, path: Path) -> int:
    """Write readings of which some are copies, some rare and some unknown."""
    sensors, rows = chance.randint(2, 12), chance.randint(5, 40)
    unknown = chance.random() < 0.4
    lines = [",".join(f"s{k}" for k in range(sensors))]
    bits = [chance.random() < 0.5 for _ in range(sensors)]
    for _ in range(rows):
        for k in range(sensors):
            if chance.random() < 0.3:
                bits[k] = bits[k - 1] if k and chance.random() < 0.6 else not bits[k]
        cells = [str(int(bit)) for bit in bits]
        if unknown and chance.random() < 0.5:
            cells[chance.randrange(sensors)] = ""
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rows


def random_run(seed: int, path: Path) -> RunOptions:
    chance = random.Random(seed)
    rows = random_source(chance, path)
    empirical = chance.random() < 0.6
    watch = chance.random() < 0.5
    return msgspec.structs.replace(
        replayed_runs.options_for(str(path)),
        ticks=rows,
        snapshot="empirical" if empirical else "discounted",
        threshold=chance.choice([0.05, 0.25, "auto"]) if empirical else 0.15,
        decay=None if empirical else 0.8,
        wiring=chance.choice(["hasse", "derived"]),
        keyframe_every=chance.choice([1, 4, 1000]),
        band=chance.choice([1 << 20, 1, 3]),
        watch=watch,
        support=chance.choice([0, 2]),
        hold=chance.choice([0, 3]),
    )


@pytest.mark.parametrize("batch", rows([range(12)], [range(12, 100)]))
def test_cells_workers_and_shares_agree_on_random_sources(
    tmp_path: Path, batch: range
) -> None:
    for seed in batch:
        options = random_run(seed, tmp_path / f"{seed}.csv")
        sensors = len(options.sensors)
        several = min(1 + seed % 3, sensors)
        kinds = {
            "cells": options,
            "inline": msgspec.structs.replace(options, workers=1),
            "worker": msgspec.structs.replace(options, cells="worker", workers=several),
            "spread": spread(options, several),
        }
        logs = {kind: tmp_path / f"{seed}-{kind}.mcap" for kind in kinds}
        for kind, given in kinds.items():
            recorded_run(given, logs[kind])
        expected, told = course(logs["cells"]), of_type(logs["cells"], wire.Anomaly)
        for kind, found in logs.items():
            assert course(found) == expected, (seed, kind)
            assert of_type(found, wire.Anomaly) == told, (seed, kind)
        looms = [
            of_type(logs[kind], wire.WorkerWiring) for kind in ("worker", "spread")
        ]
        # A key-frame makes the coordinator wire anew, and both have the same of these.
        assert looms[0] == looms[1], seed
        verdict = verify(logs["spread"])
        assert (verdict.difference, verdict.complete) == (None, True), seed
        _, learned = snapshot_at(Recording.open(logs["spread"]), options.ticks)
        _, without = snapshot_at(Recording.open(logs["worker"]), options.ticks)
        assert learned.to_bytes() == without.to_bytes(), seed


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        ({"cells": "process"}, "learning: must go with cells in workers"),
        ({"cells": "inline"}, "learning: must go with cells in workers"),
        ({"cells": "worker", "agent": "planner"}, "where sensors grow"),
    ],
)
def test_what_cannot_share_the_learning_is_refused(
    given: dict[str, object], rule: str
) -> None:
    body = Body.full(("a", "b"), ("left", "right"), room=1)
    with pytest.raises(InvalidValueError, match=rule):
        RunOptions(source="x", body=body, learning="spread", **given)  # type: ignore[arg-type]
