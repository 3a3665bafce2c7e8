"""Cells in workers come to what cells in processes do, live and from a recording."""

import asyncio
import random
from collections.abc import Callable, Iterator
from multiprocessing import active_children
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.policy import AgentKind
from neurosnap.apps.cli.recording_info import describe as describe_recording
from neurosnap.depth.measure import from_recording
from neurosnap.errors import SwarmError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.playback import play
from neurosnap.recording.replay.replay import Replay
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run import run
from neurosnap.sensorium import unpack
from tests.support import run_options
from tests.support.inline_runs import InlineSite

pytestmark = [pytest.mark.slow]

TICKS = 25
SEED = 3
GRID = "neurosnap/Grid-v0"
WAYS: list[tuple[CellKind, int]] = [
    ("process", 1),
    ("worker", 1),
    ("worker", 2),
    ("worker", 4),
]


def readings(path: Path) -> str:
    """Write rows in which each sensor implies the next, but for a few exceptions."""
    chance = random.Random(SEED)
    lines = [",".join(f"s{sensor}" for sensor in range(9))]
    for row in range(TICKS):
        first = chance.randint(0, 6)
        bits = [first <= sensor < 7 for sensor in range(7)]
        bits[3] ^= row in (18, 31)
        lines.append(",".join(str(int(b)) for b in [*bits, bits[0], not bits[5]]))
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def options_for(
    source: str, agent: AgentKind, cells: CellKind, workers: int
) -> RunOptions:
    return run_options.options_for(
        source,
        SEED,
        {"width": 3, "height": 3, "wait": True} if source == GRID else {},
        agent=agent,
        explore=0.25,
        ticks=TICKS,
        threshold=0.08,
        cells=cells,
        workers=workers,
        keyframe_every=15,
    )


def inline(
    options: RunOptions,
    log: Path,
    past: ResumePoint | None = None,
    stop_at: int = 10**9,
) -> None:
    """Run with every part a task, workers as well."""

    async def work() -> None:
        stop = asyncio.Event()

        def on_progress(tick: int) -> None:
            if tick >= stop_at:
                stop.set()

        await run(
            RunRequest(options, log, past, site=InlineSite()),
            stop,
            Watcher(on_progress),
        )

    asyncio.run(work())


class Played(NamedTuple):
    """What a run came to, whoever computed it."""

    states: list[tuple[int, bytes, bool]]
    reached: list[tuple[int, tuple[int, ...], bytes]]
    pulses: list[tuple[int, int]]
    decisions: list[wire.Decision]
    expected: list[list[bool]]


def played(log: Path) -> Played:
    recording = Recording.open(log)
    assert recording.completeness().whole
    found = Played([], [], [], [], [])
    for recorded in recording.messages():
        match recorded.message:
            case wire.State() as one:
                found.states.append((one.tick, one.literals, one.incoherent))
                found.pulses.append((one.tick, one.pulses))
            case wire.Reached() as one:
                found.reached.append((one.tick, one.signal, one.literals))
                found.pulses.append((one.tick, one.pulses))
            case wire.Decision() as decision:
                found.decisions.append(decision)
            case wire.Fault(what=what):
                pytest.fail(what)
    found.reached.sort()  # planning waves of one tick may settle in any order
    found.pulses.sort()
    return found


def states_by_snapshot(log: Path, options: RunOptions) -> list[list[bool]]:
    """Return what the snapshot says by itself of what was observed."""
    snapshot = options.new_snapshot()
    return [
        snapshot.observe(unpack(message.bits, len(options.sensors))).tolist()
        for message in (r.message for r in Recording.open(log).messages(("observe",)))
        if isinstance(message, wire.Observation)
    ]


def ways(log: Path) -> Iterator[tuple[int, int]]:
    """Yield the depth of each planning wave, and of the shortest ways it could take."""
    results: dict[int, list[wire.Reached]] = {}
    for recorded in Recording.open(log).messages(("reach",)):
        if isinstance(recorded.message, wire.Reached):
            results.setdefault(recorded.message.tick, []).append(recorded.message)
    replay = Replay(Recording.open(log))
    for tick in replay.ticks():
        for result in results.get(tick, []):
            yield result.depth, replay.core.graph.depth(result.signal)


# What comes out -----------------------------------------------------------------------


@pytest.mark.zenoh
@pytest.mark.parametrize(
    ("source", "agent"), [("csv", "walker"), (GRID, "walker"), (GRID, "planner")]
)
async def test_any_number_of_workers_comes_to_what_processes_come_to(
    source: str, agent: AgentKind, tmp_path: Path
) -> None:
    if source == "csv":
        source = readings(tmp_path / "readings.csv")
    found = []
    for cells, workers in WAYS:
        options = options_for(source, agent, cells, workers)
        log = tmp_path / f"{cells}-{workers}.mcap"
        outcome = await run(RunRequest(options, log), asyncio.Event())
        assert outcome.completeness is not None
        assert outcome.completeness.whole
        one = played(log)
        literals = 2 * len(options.sensors)
        states = [unpack(state, literals).tolist() for _, state, _ in one.states]
        assert states == states_by_snapshot(log, options)
        assert len(states) == TICKS
        verdict = verify(log)
        assert (verdict.same, verdict.complete) == (True, True), verdict.difference
        assert verdict.wirings > 1
        found.append(one)
    # Even the pulses are as many: every literal above the signal fires, once.
    assert all(one == found[0] for one in found)
    assert len(found[0].reached) > 0 or agent == "walker"


def test_waves_in_one_worker_take_the_shortest_ways(tmp_path: Path) -> None:
    # In one worker nothing is left to chance. Among more, or among processes, which way
    # a wave first comes depends on what is faster at that time.
    depths: dict[int, list[tuple[int, int]]] = {}
    for workers in (1, 3):
        options = options_for(GRID, "planner", "worker", workers)
        log = tmp_path / f"{workers}.mcap"
        inline(options, log)
        depths[workers] = sorted(ways(log))
    assert all(depth == shortest for depth, shortest in depths[1])
    assert all(depth >= shortest for depth, shortest in depths[3])
    assert max(depth for depth, _ in depths[1]) > 2


def test_workers_go_the_same_way_each_time(tmp_path: Path) -> None:
    options = options_for(GRID, "planner", "worker", 3)
    topics = ("observe", "loom", "wave", "burst", "tally", "state", "reach", "decide")
    payloads = []
    for number in range(2):
        inline(options, tmp_path / f"{number}.mcap")
        recording = Recording.open(tmp_path / f"{number}.mcap")
        payloads.append([r.payload for r in recording.messages(topics)])
    assert payloads[0] == payloads[1]
    assert any(b'"type":"burst"' in payload for payload in payloads[0])


# From a recording ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("workers")
    source = readings(folder / "readings.csv")
    path = folder / "log.mcap"
    inline(options_for(source, "walker", "worker", 3), path)
    return path


def test_what_workers_said_is_counted(log: Path) -> None:
    info = describe_recording(Recording.open(log))
    counts = {channel.topic: channel.messages for channel in info.channels}
    assert counts["/state"] == TICKS
    assert min(counts["/loom"], counts["/burst"], counts["/tally"]) > 0
    assert not counts.keys() & {"/wiring", "/excite", "/settle"}
    assert info.completeness.whole


def test_depth_is_read_from_workers_reports(log: Path) -> None:
    rows = from_recording(Recording.open(log))
    assert len(rows) >= TICKS
    assert {row.sensors for row in rows} == {9}
    assert any(row.depth > 0 for row in rows)
    assert all(row.depth <= row.height + 2 for row in rows)


Change = Callable[[Recorded], wire.Message]


def tampered(log: Path, path: Path, change: Change) -> Path:
    """Copy a recording with its messages changed."""
    recording = Recording.open(log)
    with Writer(path) as writer:
        writer.start(recording.metadata)
        sent: dict[str, int] = {}
        for recorded in recording.messages():
            payload = wire.encode(change(recorded))
            delivery = recorded.delivery._replace(payload=payload)
            writer.add(delivery, recorded.log_time)
            sender = recorded.message.sender
            sent[sender] = max(sent.get(sender, 0), recorded.sequence + 1)
        writer.finish(recording.totals or {}, sent)
    return path


def test_a_report_that_leaves_out_a_literal_is_found(log: Path, tmp_path: Path) -> None:
    left = [True]

    def forget(recorded: Recorded) -> wire.Message:
        message = recorded.message
        if isinstance(message, wire.WorkerReport) and message.wave > 20 and left:
            if message.literals:
                left.clear()
            return msgspec.structs.replace(
                message, literals=message.literals[4:], hops=message.hops[4:]
            )
        return message

    verdict = verify(tampered(log, tmp_path / "forgets.mcap", forget))
    assert not left
    assert not verdict.same
    assert verdict.difference is not None


def test_an_edge_left_out_of_a_wiring_is_found(log: Path, tmp_path: Path) -> None:
    left = [True]

    def forget(recorded: Recorded) -> wire.Message:
        message = recorded.message
        if isinstance(message, wire.WorkerWiring) and message.add and left:
            left.clear()
            return msgspec.structs.replace(message, add=message.add[8:])
        return message

    verdict = verify(tampered(log, tmp_path / "edge.mcap", forget))
    assert not verdict.same
    assert "/loom coordinator" in str(verdict.difference)


def test_a_run_of_workers_goes_on_where_it_ended(tmp_path: Path) -> None:
    options = options_for(GRID, "planner", "worker", 2)
    whole, first, rest = (tmp_path / f"{name}.mcap" for name in ("whole", "a", "b"))
    inline(options, whole)
    inline(options, first, stop_at=8)
    again, past = find_resume_point(first)
    assert 8 <= past.tick < TICKS
    assert again == options
    assert {"worker/0", "worker/1"} <= past.counts.keys()
    inline(msgspec.structs.replace(again, ticks=TICKS), rest, past)
    verdict = verify(rest)
    assert (verdict.same, verdict.complete) == (True, True), verdict.difference
    resumed, straight = played(rest), played(whole)
    assert resumed.states == straight.states
    assert resumed.reached == straight.reached
    assert resumed.decisions[: past.tick] == straight.decisions[: past.tick]


class Listener:
    """An end of a network that keeps what is sent through it."""

    def __init__(self) -> None:
        self.heard: list[wire.Delivery] = []

    def forward(self, delivery: wire.Delivery) -> None:
        self.heard.append(delivery)

    def publish(self, *messages: wire.Message) -> None:
        raise AssertionError(messages)


async def test_a_recording_of_workers_plays_back(log: Path) -> None:
    recording, listener = Recording.open(log), Listener()
    await play(recording, listener, asyncio.Event(), rate=1e6)  # type: ignore[arg-type]
    assert listener.heard == [recorded.delivery for recorded in recording.messages()]


# What goes wrong ----------------------------------------------------------------------


@pytest.mark.zenoh
async def test_a_worker_that_dies_ends_the_run_and_is_named(tmp_path: Path) -> None:
    options = options_for(GRID, "walker", "worker", 2)
    options = msgspec.structs.replace(options, ticks=100_000)

    def on_progress(tick: int) -> None:
        if tick >= 3:
            for child in active_children():
                if child.name == "worker/1" and child.pid:
                    child.kill()

    with pytest.raises(SwarmError, match=r"^(coordinator: )?worker/1: must "):
        await run(
            RunRequest(options, tmp_path / "log.mcap"),
            asyncio.Event(),
            Watcher(on_progress),
        )
    recording = Recording.open(tmp_path / "log.mcap")
    assert recording.cut is None
    assert "worker/1" in recording.completeness().missing
