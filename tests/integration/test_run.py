"""Whole swarms, in processes and inline: what they compute, and how they end."""

import asyncio
import contextlib
import multiprocessing.process
import random
import re
import resource
import signal
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Self, TypeVar

import msgspec
import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import (
    NeurosnapError,
    RecordingError,
    SwarmError,
    WaveLostError,
)
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.fabric.protocol import Handler, PlaceHandler, PresenceHandler
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import (
    CellKind,
    RunOptions,
    SnapshotKind,
    WiringKind,
)
from neurosnap.recording.read.reader import Recording
from neurosnap.runtime.parts.cell_process import run_cell
from neurosnap.runtime.parts.coordinator_loop import run_coordinator
from neurosnap.runtime.parts.participant import take_part
from neurosnap.runtime.parts.world_process import run_world
from neurosnap.runtime.run import Outcome, run
from neurosnap.sensorium import complete, unpack
from neurosnap.sources.open import open_source
from tests.support.patience import PATIENCE

pytestmark = pytest.mark.slow

SENSORS = 8
TICKS = 40
SEED = 3

M = TypeVar("M")


@pytest.fixture(autouse=True)
def no_process_is_left() -> Iterator[None]:
    """Fail if a process outlives the test, other than those that serve for good."""
    yield
    left = []
    for child in psutil.Process().children():
        command = " ".join(child.cmdline())
        if "forkserver" in command:
            left += child.children(recursive=True)
        elif "resource_tracker" not in command:
            left.append(child)
    _, alive = psutil.wait_procs(left, timeout=PATIENCE)  # the fork server may yet reap
    assert alive == []


def write_readings(path: Path, rows: int, sensors: int = SENSORS) -> str:
    """Write rows in which s0 implies s1 until that fails, at row 20 and at row 30."""
    chance = random.Random(3)
    lines = [",".join(f"s{sensor}" for sensor in range(sensors))]
    for row in range(1, rows + 1):
        bits = [chance.random() < 0.5 for _ in range(sensors)]
        bits[1] = (bits[0] or bits[1]) if row not in (20, 30) else False
        bits[0] = bits[0] or row in (20, 30)
        bits[3] = bits[2]  # equivalent
        lines.append(",".join(str(int(bit)) for bit in bits))
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def options_for(
    source: str,
    *,
    cells: CellKind = "inline",
    wiring: WiringKind = "hasse",
    snapshot: SnapshotKind = "empirical",
    ticks: int = TICKS,
    deadline: float = 10.0,
) -> RunOptions:
    opened = open_source(source, SEED)
    opened.close()
    return RunOptions(
        source=source,
        body=Body(own=opened.sensors, actions=opened.actions),
        ticks=ticks,
        seed=SEED,
        snapshot=snapshot,
        threshold=0.1 if snapshot == "empirical" else 1 / 32,
        wiring=wiring,
        cells=cells,
        deadline=deadline,
    )


@pytest.fixture
def readings(tmp_path: Path) -> str:
    return write_readings(tmp_path / "readings.csv", TICKS)


@pytest.fixture
def endless(tmp_path: Path) -> str:
    """Return a source of few sensors that nobody comes to the end of."""
    return write_readings(tmp_path / "endless.csv", 100_000, sensors=4)


class Played:
    """What became of a run, from its recording."""

    def __init__(self, log: Path, outcome: Outcome | None = None) -> None:
        self.recording = Recording.open(log)
        self.outcome = outcome
        self.recorded = list(self.recording.messages())

    def of(self, kind: type[M]) -> list[M]:
        return [r.message for r in self.recorded if isinstance(r.message, kind)]

    def payloads(self, *topics: str) -> list[bytes]:
        return [r.payload for r in self.recording.messages(topics)]

    @property
    def states(self) -> list[tuple[int, bytes, bool]]:
        return [(s.tick, s.literals, s.incoherent) for s in self.of(wire.State)]

    @property
    def reached(self) -> list[tuple[int, tuple[int, ...], bytes]]:
        return [(r.tick, r.signal, r.literals) for r in self.of(wire.Reached)]

    @property
    def decisions(self) -> list[wire.Decision]:
        return self.of(wire.Decision)


async def play(
    options: RunOptions,
    log: Path,
    stop: asyncio.Event | None = None,
    on_progress: Callable[[int], None] = lambda _: None,
) -> Played:
    """Run a swarm and read what was recorded."""
    outcome = await run(options, log, stop or asyncio.Event(), on_progress)
    return Played(log, outcome)


# What comes out -----------------------------------------------------------------------


async def test_the_same_seed_gives_the_same_recording(
    readings: str, tmp_path: Path
) -> None:
    for source in (readings, "neurosnap/Path-v0"):
        options = options_for(source)
        first, second = [
            await play(options, tmp_path / f"{number}-{Path(source).stem}.mcap")
            for number in range(2)
        ]
        topics = ("observe", "wiring", "wave", "state", "reach", "decide", "keyframe")
        assert first.payloads(*topics) == second.payloads(*topics)
        assert len(first.states) == TICKS
        assert first.recording.finished
        assert first.recording.completeness().whole


async def test_the_seed_matters(tmp_path: Path) -> None:
    options = options_for("neurosnap/Path-v0")
    other = msgspec.structs.replace(options, seed=SEED + 1)
    first = await play(options, tmp_path / "first.mcap")
    second = await play(other, tmp_path / "second.mcap")
    assert first.states != second.states
    assert first.decisions != second.decisions


def expected_states(played: Played, options: RunOptions) -> list[list[bool]]:
    """Return what the snapshot says by itself of what was observed."""
    snapshot = options.new_snapshot()
    observed = played.of(wire.Observation)
    sensors = len(options.sensors)
    return [snapshot.observe(unpack(o.bits, sensors)).tolist() for o in observed]


async def check_alike(
    source: str,
    tmp_path: Path,
    kinds: Sequence[tuple[CellKind, WiringKind]],
    snapshot: SnapshotKind = "empirical",
) -> Played:
    """Play `source` in each way; all must come to the same, and to what is right."""
    reference: Played | None = None
    for cells, wiring in kinds:
        options = options_for(source, cells=cells, wiring=wiring, snapshot=snapshot)
        played = await play(options, tmp_path / f"{cells}-{wiring}.mcap")
        assert played.recording.completeness().whole
        literals = 2 * len(options.sensors)
        states = [unpack(s.literals, literals).tolist() for s in played.of(wire.State)]
        assert len(states) == TICKS
        assert states == expected_states(played, options)
        if reference is not None:
            assert played.states == reference.states
            assert played.reached == reference.reached
            assert played.decisions == reference.decisions
        reference = reference or played
    assert reference is not None
    return reference


EVERY_WAY: list[tuple[CellKind, WiringKind]] = [
    ("inline", "hasse"),
    ("inline", "derived"),
    ("process", "hasse"),
    ("process", "derived"),
]


async def test_processes_and_tasks_and_both_wirings_come_to_the_same(
    readings: str, tmp_path: Path
) -> None:
    played = await check_alike(readings, tmp_path, EVERY_WAY)
    assert any(incoherent for _, _, incoherent in played.states)
    assert any(state.height > 0 for state in played.of(wire.State))


async def test_a_world_that_is_acted_on_goes_the_same_way(tmp_path: Path) -> None:
    ways = [EVERY_WAY[0], EVERY_WAY[2]]
    played = await check_alike("neurosnap/Path-v0", tmp_path, ways)
    assert {decision.action for decision in played.decisions[1:]} == {0, 1}
    assert max(reached.depth for reached in played.of(wire.Reached)) > 3


async def test_discounted_weights_come_to_the_same(
    readings: str, tmp_path: Path
) -> None:
    for source in (readings, "neurosnap/Path-v0"):
        folder = tmp_path / Path(source).stem
        folder.mkdir()
        await check_alike(source, folder, EVERY_WAY[:2], "discounted")


async def test_two_runs_at_once_do_not_notice_each_other(
    readings: str, tmp_path: Path
) -> None:
    sources = {"a": readings, "b": "neurosnap/Path-v0"}
    tasks: dict[str, asyncio.Task[Played]] = {}
    async with asyncio.TaskGroup() as group:
        for name, source in sources.items():
            options = options_for(source, cells="process", ticks=20)
            log = tmp_path / f"{name}.mcap"
            tasks[name] = group.create_task(play(options, log))
    for name, source in sources.items():
        together = tasks[name].result()
        alone = await play(options_for(source, ticks=20), tmp_path / f"{name}0.mcap")
        assert together.states == alone.states
        assert together.decisions == alone.decisions
        assert together.recording.completeness().whole
        assert together.of(wire.Fault) == []


# The swarm computes, by hand ----------------------------------------------------------


class Meddled:
    """A part's end of the network with somebody in between.

    Args:
        inner: The end proper.
        outgoing: What becomes of a message that is sent; None: it is withheld.
        incoming: What becomes of a message that arrives.
    """

    def __init__(
        self,
        inner: MemoryFabric,
        outgoing: Callable[[wire.Message], wire.Message | None] = lambda m: m,
        incoming: Callable[[wire.Message], wire.Message] = lambda m: m,
    ) -> None:
        self._inner = inner
        self._outgoing = outgoing
        self._incoming = incoming

    @property
    def who(self) -> str:
        return self._inner.who

    @property
    def sent(self) -> int:
        return self._inner.sent

    def publish(self, *messages: wire.Message) -> None:
        for message in messages:
            passed = self._outgoing(message)
            if passed is not None:
                self._inner.publish(passed)

    async def subscribe(
        self, keys: Sequence[str], handler: Handler, *, poll: float | None = None
    ) -> None:
        def handle(deliveries: list[wire.Delivery]) -> None:
            for delivery in deliveries:
                message = self._incoming(wire.decode(delivery.key, delivery.payload))
                handler([delivery._replace(payload=wire.encode(message))])

        await self._inner.subscribe(keys, handle, poll=poll)

    async def announce(self) -> None:
        await self._inner.announce()

    async def confirm(self) -> None:
        await self._inner.confirm()

    async def watch(self, handler: PresenceHandler) -> None:
        await self._inner.watch(handler)

    async def locate(self, handler: PlaceHandler) -> None:
        await self._inner.locate(handler)

    async def serve(self, stop: asyncio.Event) -> None:
        await self._inner.serve(stop)

    def fail(self, error: BaseException) -> None:
        self._inner.fail(error)

    async def __aenter__(self) -> Self:
        await self._inner.__aenter__()
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._inner.__aexit__(None, None, None)


Meddle = Callable[[MemoryFabric], Meddled]


async def by_hand(
    options: RunOptions,
    heard: list[wire.Message],
    meddle: Meddle = Meddled,
    absent: Collection[str] = (),
    patience: float = 10.0,
) -> None:
    """Run a swarm part by part; `heard` gets what the coordinator said."""
    hub, leave = MemoryHub(), asyncio.Event()
    source = open_source(options.source, options.seed)
    cells = options.host_names()

    def listen(deliveries: list[wire.Delivery]) -> None:
        heard.extend(wire.decode(d.key, d.payload) for d in deliveries)

    async def be_cell(number: int) -> None:
        async with meddle(hub.fabric(cells[number])) as fabric:
            await take_part(fabric, run_cell(number, fabric, leave))

    async def be_world() -> None:
        async with hub.fabric("world") as fabric:
            await take_part(
                fabric, run_world(source, Body(own=source.sensors), fabric, leave)
            )

    hub.fabric("listener").listen(("state", "reach"), listen)
    try:
        async with asyncio.TaskGroup() as group:
            for number, who in enumerate(cells):
                if who not in absent:
                    group.create_task(be_cell(number), name=who)
            group.create_task(be_world(), name="world")
            async with hub.fabric("coordinator") as fabric:
                await run_coordinator(
                    Coordinator.of(options),
                    fabric,
                    asyncio.Event(),
                    parts=["world", *cells],
                    deadline=options.deadline,
                    patience=patience,
                )
            leave.set()
    except BaseExceptionGroup as errors:
        (error,) = errors.exceptions
        raise error from None
    finally:
        source.close()


def states_in(heard: Sequence[wire.Message]) -> list[list[bool]]:
    return [
        unpack(message.literals, 2 * SENSORS).tolist()
        for message in heard
        if isinstance(message, wire.State)
    ]


async def test_without_one_cells_reports_there_is_no_state_and_it_is_named(
    readings: str,
) -> None:
    def withhold(end: MemoryFabric) -> Meddled:
        def outgoing(message: wire.Message) -> wire.Message | None:
            mute = isinstance(message, wire.CellReport) and message.cell == 5
            return None if mute else message

        return Meddled(end, outgoing)

    heard: list[wire.Message] = []
    expected = (
        r"^wave 3 \(tick 1\): must settle within its deadline, got 3 tries;"
        r" missing credit 0\.\d+, silent cells: cell/5$"
    )
    with pytest.raises(WaveLostError, match=expected):
        await by_hand(options_for(readings, deadline=0.2), heard, withhold)
    assert heard == []


async def test_with_one_report_too_few_the_run_goes_on_after_a_repeat(
    readings: str,
) -> None:
    lost: list[wire.CellReport] = []

    def lose_one(end: MemoryFabric) -> Meddled:
        def outgoing(message: wire.Message) -> wire.Message | None:
            if isinstance(message, wire.CellReport) and message.wave == 9 and not lost:
                lost.append(message)
                return None
            return message

        return Meddled(end, outgoing)

    options = options_for(readings, deadline=0.2)
    undisturbed: list[wire.Message] = []
    heard: list[wire.Message] = []
    await by_hand(options, undisturbed)
    await by_hand(options, heard, lose_one)
    assert len(lost) == 1
    assert states_in(heard) == states_in(undisturbed)
    assert len(states_in(heard)) == TICKS


def reach(edges: NDArray[np.bool_], start: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return all that paths from `start` lead to."""
    found = start.copy()
    while True:
        more = found | edges[found].any(axis=0)
        if (more == found).all():
            return found
        found = more


async def test_the_wiring_a_cell_has_is_what_the_state_comes_of(readings: str) -> None:
    # The cell of s6 is told that s6 implies not s7, which nobody has learned.
    source, target = 12, 15

    def mislead(end: MemoryFabric) -> Meddled:
        def incoming(message: wire.Message) -> wire.Message:
            if isinstance(message, wire.Wiring) and message.cell == source // 2:
                return msgspec.structs.replace(
                    message,
                    add=tuple(sorted({*message.add, target})),
                    drop=tuple(b for b in message.drop if b != target),
                )
            return message

        return Meddled(end, incoming=incoming)

    options = options_for(readings)
    heard: list[wire.Message] = []
    await by_hand(options, heard, mislead)

    snapshot, honest = options.new_snapshot(), []
    expected, graphs = [], []
    opened = open_source(readings, SEED)
    bits: NDArray[np.bool_] | None = opened.first()
    while bits is not None:
        honest.append(snapshot.observe(bits).tolist())
        edges = snapshot.poc_graph().hasse().copy()
        edges[source, target] = True
        graphs.append(edges)
        above = reach(edges, complete(bits))
        expected.append((above & ~above.reshape(-1, 2)[:, ::-1].reshape(-1)).tolist())
        bits = opened.step(-1)
    opened.close()
    assert states_in(heard) == expected
    differ = sum(one != other for one, other in zip(expected, honest, strict=True))
    assert differ > TICKS / 8
    for message in heard:
        if isinstance(message, wire.Reached):
            start = np.zeros(2 * SENSORS, np.bool_)
            start[list(message.signal)] = True
            above = reach(graphs[message.tick - 1], start)
            assert unpack(message.literals, 2 * SENSORS).tolist() == above.tolist()


async def test_a_cell_that_never_comes_up_is_named(readings: str) -> None:
    expected = (
        r"^swarm: every part must come up within 0\.05 s, missing: cell/2, cell/6$"
    )
    with pytest.raises(SwarmError, match=expected):
        await by_hand(
            options_for(readings), [], absent=["cell/6", "cell/2"], patience=0.05
        )


async def test_what_is_no_message_is_reported_and_counted_once(readings: str) -> None:
    hub, stop, reported = MemoryHub(), asyncio.Event(), asyncio.Event()
    core = Coordinator.of(options_for(readings))
    async with hub.fabric("coordinator") as fabric, hub.fabric("witness") as witness:
        conducting = asyncio.create_task(
            run_coordinator(core, fabric, stop, parts=[], deadline=10)
        )
        await asyncio.sleep(0)
        await witness.subscribe(("fault/**",), lambda _: reported.set())
        hub.send("stranger", wire.Delivery("settle/cell/0", 0, 0, b"garbage"))
        await reported.wait()
        stop.set()
        await conducting
    assert core.totals.faults == 1


async def test_a_part_that_goes_without_a_word_is_named(readings: str) -> None:
    hub, there = MemoryHub(), asyncio.Event()

    async def be_there() -> None:
        async with hub.fabric("cell/0") as end:
            await end.announce()
            await there.wait()

    async def conduct_it() -> None:
        async with hub.fabric("coordinator") as fabric:
            core = Coordinator.of(options_for(readings))
            await run_coordinator(core, fabric, stop, parts=["cell/0"], deadline=10)

    stop = asyncio.Event()
    expected = r"^cell/0: must stay until the run ends, is gone$"
    with pytest.raises(ExceptionGroup) as caught:
        async with asyncio.TaskGroup() as group:
            group.create_task(be_there())
            group.create_task(conduct_it())
            await asyncio.sleep(0)
            there.set()
    (error,) = caught.value.exceptions
    assert isinstance(error, SwarmError)
    assert re.search(expected, str(error))


async def test_the_world_answers_each_decision_once_and_in_turn(readings: str) -> None:
    hub, over = MemoryHub(), asyncio.Event()
    source = open_source(readings, SEED)
    told: list[int] = []

    def listen(deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            message = wire.decode(delivery.key, delivery.payload)
            assert isinstance(message, wire.Observation)
            told.append(message.tick)
            if message.tick == 3:
                over.set()

    hub.fabric("listener").listen(("observe",), listen)
    async with hub.fabric("world") as end:
        world = asyncio.create_task(
            run_world(source, Body(own=source.sensors), end, over)
        )
        await asyncio.sleep(0)
        for tick in (0, 0, 5, 1, 0, 1, 2):
            hub.fabric("coordinator").publish(wire.Decision(tick, -1, ""))
        await world
    source.close()
    assert told == [1, 2, 3]


# How runs end -------------------------------------------------------------------------


def at(
    tick: int, act: Callable[[], object], also: Callable[[], bool] = lambda: True
) -> Callable[[int], None]:
    """Return what watches the progress and acts once, when `tick` is reached."""
    done: list[int] = []

    def on_progress(reached: int) -> None:
        if reached >= tick and not done and also():
            done.append(reached)
            act()

    return on_progress


def holds_states(log: Path) -> bool:
    """Return whether any state has reached the file."""
    return any(Recording.open(log).messages(["state"]))


def child(name: str) -> psutil.Process:
    """Return one process of the swarm under way."""
    # Not `active_children`, which waits for those that have ended.
    active = vars(multiprocessing.process)["_children"]
    (found,) = [p for p in active if p.name == name]
    return psutil.Process(found.pid)


@pytest.mark.parametrize("cells", ["inline", "process"])
async def test_asked_to_stop_it_ends_in_order(
    endless: str, tmp_path: Path, cells: CellKind
) -> None:
    options = options_for(endless, cells=cells, ticks=100_000)
    stop = asyncio.Event()
    played = await play(options, tmp_path / "log.mcap", stop, at(5, stop.set))
    assert played.outcome is not None
    assert played.outcome.stopped
    assert played.recording.finished
    assert played.recording.completeness().whole
    ticks = [state.tick for state in played.of(wire.State)]
    assert ticks == list(range(1, played.outcome.totals.ticks + 1))
    assert 5 <= len(ticks) < 100_000
    assert [frame.tick for frame in played.of(wire.KeyFrame)][-1] == ticks[-1]
    assert {leave.who for leave in played.of(wire.Leave)} == {
        "coordinator",
        "world",
        *options.host_names(),
    }


@pytest.mark.parametrize("cells", ["inline", "process"])
async def test_a_source_that_is_over_ends_the_run_in_order(
    readings: str, tmp_path: Path, cells: CellKind
) -> None:
    options = options_for(readings, cells=cells, ticks=100_000)
    played = await play(options, tmp_path / "log.mcap")
    assert played.outcome is not None
    assert not played.outcome.stopped
    assert len(played.states) == played.outcome.totals.ticks == TICKS
    assert played.recording.completeness().whole


async def test_a_cell_that_dies_ends_the_run_and_is_named(
    endless: str, tmp_path: Path
) -> None:
    options = options_for(endless, cells="process", ticks=100_000)
    log = tmp_path / "log.mcap"
    with pytest.raises(SwarmError, match=r"^(coordinator: )?cell/2: must "):
        await run(
            options,
            log,
            asyncio.Event(),
            at(3, lambda: child("cell/2").send_signal(signal.SIGKILL)),
        )
    played = Played(log)
    assert [tick for tick, _, _ in played.states[:3]] == [1, 2, 3]
    assert played.recording.finished
    assert "cell/2" in played.recording.completeness().missing


@pytest.mark.parametrize("who", ["recorder", "coordinator", "hub"])
async def test_whoever_dies_ends_the_run_and_is_named(
    endless: str, tmp_path: Path, who: str
) -> None:
    options = options_for(endless, cells="process", ticks=100_000)
    log = tmp_path / "log.mcap"
    with pytest.raises(SwarmError, match=rf"\b{who}: must "):
        await run(
            options,
            log,
            asyncio.Event(),
            at(
                3,
                lambda: child(who).send_signal(signal.SIGKILL),
                lambda: holds_states(log),
            ),
        )
    assert len(Played(log).states) >= 1


BROKEN = """
import gymnasium
from gymnasium.spaces import Discrete, MultiBinary
import numpy as np


class Broken(gymnasium.Env):
    observation_space = MultiBinary(3)
    action_space = Discrete(2)

    def __init__(self, how="raise"):
        self.how = how
        self.taken = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(3, np.int8), {}

    def step(self, action):
        self.taken += 1
        if self.taken == 5 and self.how == "raise":
            raise OSError("the camera is gone")
        seen = np.zeros(3 if self.taken < 5 else 4, np.int8)
        return seen, 0.0, False, False, {}


for how in ("raise", "grow"):
    gymnasium.register(
        id=f"Broken-{how}-v0",
        entry_point=Broken,
        kwargs={"how": how},
        disable_env_checker=True,
        order_enforce=False,
    )
"""


@pytest.mark.parametrize("cells", ["inline", "process"])
@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ("raise", r"^world: [\s\S]*OSError: the camera is gone"),
        ("grow", r"^(world: )?broken_world:Broken-grow-v0: observation: "),
    ],
)
async def test_a_world_that_fails_on_the_way_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cells: CellKind,
    how: str,
    expected: str,
) -> None:
    (tmp_path / "broken_world.py").write_text(BROKEN)
    monkeypatch.syspath_prepend(tmp_path)
    options = options_for(f"broken_world:Broken-{how}-v0", cells=cells)
    log = tmp_path / "log.mcap"
    with pytest.raises(NeurosnapError, match=expected):
        await run(options, log, asyncio.Event())
    played = Played(log)
    assert [tick for tick, _, _ in played.states] == [1, 2, 3, 4, 5]
    (fault,) = played.of(wire.Fault)
    assert fault.who == "world"


LIMIT = 150_000  # bytes, far more than what is flushed at once


@contextlib.contextmanager
def files_no_larger_than(size: int) -> Iterator[None]:
    """Let this process write no file beyond `size` bytes, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


async def test_a_full_disk_ends_the_run_and_the_log_is_named(
    endless: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    options = options_for(endless, ticks=100_000)
    with (
        pytest.raises(
            RecordingError,
            match=rf"^log: must take what is recorded, got File too large for '{log}'$",
        ),
        files_no_larger_than(LIMIT),
    ):
        await run(options, log, asyncio.Event())
    played = Played(log)
    assert not played.recording.finished
    assert played.states[0][0] == 1
    assert log.stat().st_size <= LIMIT


async def test_a_full_disk_under_the_recorders_process_is_named_as_well(
    endless: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    options = options_for(endless, cells="process", ticks=100_000)

    def fill() -> None:
        size = log.stat().st_size + 1000
        child("recorder").rlimit(psutil.RLIMIT_FSIZE, (size, size))

    expected = (
        rf"^recorder: log: must take what is recorded, got File too large for '{log}'$"
    )
    with pytest.raises(SwarmError, match=expected):
        await run(options, log, asyncio.Event(), at(5, fill, lambda: holds_states(log)))
    assert len(Played(log).states) >= 1
