"""A run goes on when a part of it dies, and comes to the same."""

import asyncio
import contextlib
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import (
    InvalidValueError,
    PartDiedError,
    RecordingError,
    SwarmError,
)
from neurosnap.protocol.run_options import SMALLEST, RunOptions
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.read.split_files import part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.hosts import remote_parts
from neurosnap.runtime.hosts.service import Served, serve
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.job import Job, PartConnection
from neurosnap.runtime.restart import Restart, run_with_restarts
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.restart_policy import Supervision
from neurosnap.runtime.run import Outcome, run
from neurosnap.runtime.supervisor import Child, Supervisor
from neurosnap.sources.open import open_source
from tests.support import run_options
from tests.support.course import course
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tools.soak.__main__ import SERVICES, soak, soak_outside

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

PATH = "neurosnap/Path-v0"
SENSORS = 4
ENDLESS = 1_000_000  # ticks; whoever runs so many is ended by an event


@pytest.fixture(autouse=True)
def no_process_is_left() -> Iterator[None]:
    before = set(parts())
    yield
    _, alive = psutil.wait_procs(set(parts()) - before, timeout=PATIENCE)
    assert not alive


def parts() -> list[psutil.Process]:
    """The parts of swarms of this process; the fork server stays for the next one."""
    kinds = ("hub", "recorder", "coordinator", "world", "cell")
    found = []
    for one in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            if one.name().partition("/")[0] in kinds:
                found.append(one)
    return found


def options_for(ticks: int) -> RunOptions:
    return run_options.options_for(PATH, 3, {"places": SENSORS + 1}, ticks=ticks)


def on_disk(log: Path) -> int:
    """Return the last tick of which a recording that grows holds the state."""
    last = max(part_paths(log).values(), default=log)
    try:
        recording = Recording.open(last)
        states = [recorded.message for recorded in recording.messages(("state",))]
    except RecordingError:  # it has just begun
        return 0
    return max((m.tick for m in states if isinstance(m, wire.State)), default=0)


class Disturbed:
    """A run of which parts are killed, each time once enough of it is on disk.

    It is not bound by its ticks: it ends in order once it has gone on after the last
    of the killings, however fast or slow the machine is.
    """

    def __init__(self, options: RunOptions, log: Path, **supervision: object) -> None:
        self.restarts: list[Restart] = []
        self.flushed: list[int] = []
        """The last tick that was on disk, of each killing."""
        self._options = options
        self._log = log
        self._supervision = msgspec.convert(
            {"backoff": 0.0, **supervision}, Supervision
        )

    def run(self, *killings: tuple[int, tuple[str, ...]]) -> Outcome:
        """Make the run; in each of its lives, parts are killed together.

        Args:
            *killings: How many ticks of this life must be on disk, and who dies then.
        """
        return asyncio.run(self.running(*killings))

    async def running(
        self, *killings: tuple[int, tuple[str, ...]], **where: Any
    ) -> Outcome:
        """Make the run; `where` as `run_with_restarts` takes it."""
        stop = asyncio.Event()

        def on_progress(tick: int) -> None:
            life = len(self.restarts)
            begun = self.restarts[-1].tick if self.restarts else 0
            if life == len(self.flushed) < len(killings):
                ticks, victims = killings[life]
                flushed = on_disk(self._log)
                found = {one.name(): one for one in parts()}
                if flushed >= begun + ticks and found.keys() >= set(victims):
                    self.flushed.append(flushed)
                    for victim in victims:
                        found[victim].send_signal(signal.SIGKILL)
            elif killings and life == len(killings) and tick > begun:
                stop.set()

        return await run_with_restarts(
            self._options,
            self._log,
            stop,
            self._supervision,
            on_progress=on_progress,
            on_restart=self.restarts.append,
            **where,
        )


def check_same(
    outcome: Outcome, disturbed: Disturbed, log: Path, options: RunOptions, calm: Path
) -> None:
    """Check that a run came to what an undisturbed one of as many ticks comes to."""
    ticks = outcome.totals.ticks
    inline = msgspec.structs.replace(options, ticks=ticks, cells="inline", split=0)
    undisturbed = asyncio.run(run(inline, calm, asyncio.Event()))
    assert undisturbed.totals.ticks == ticks
    assert outcome.implications == undisturbed.implications
    assert course(log, ticks) == course(calm)
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, ticks)
    assert (outcome.restarts, len(disturbed.restarts)) == (2, 2)
    # Of the last tick on disk not all may be there; of the one before it all is.
    for restart, flushed in zip(disturbed.restarts, disturbed.flushed, strict=True):
        assert restart.tick >= flushed - 1
    first, second = disturbed.restarts
    assert first.tick < second.tick < ticks


@pytest.mark.parametrize(
    "victims",
    [
        ("cell/2",),
        ("hub",),
        ("recorder",),
        ("coordinator",),
        ("world",),
        ("recorder", "coordinator"),
        ("hub", "recorder", "world", "cell/0"),
    ],
    ids="+".join,
)
def test_whoever_dies_the_run_comes_to_the_same(
    victims: tuple[str, ...], tmp_path: Path
) -> None:
    options = options_for(ENDLESS)
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log)
    outcome = disturbed.run((20, victims), (20, victims))
    assert disturbed.restarts[0].why.startswith(tuple(victims))
    check_same(outcome, disturbed, log, options, calm)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]


@pytest.mark.parametrize("victim", ["recorder", "coordinator", "cell/2"])
def test_a_run_in_several_files_comes_to_the_same(victim: str, tmp_path: Path) -> None:
    options = msgspec.structs.replace(
        options_for(ENDLESS), keyframe_every=50, split=SMALLEST
    )
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log)
    # A file takes some 250 ticks.
    outcome = disturbed.run((300, (victim,)), (300, (victim,)))
    check_same(outcome, disturbed, log, options, calm)
    files = part_paths(log)
    assert verify(log).files == len(files) > 2
    assert list(files) == list(range(len(files)))
    for path in list(files.values())[1:]:
        alone = verify(path)
        assert (alone.same, alone.complete) == (True, True)
    assert sorted(tmp_path.iterdir()) == sorted([calm, *files.values()])


def test_files_that_cannot_be_gone_on_from_are_kept(tmp_path: Path) -> None:
    log = tmp_path / "log"
    options = msgspec.structs.replace(
        options_for(ENDLESS), keyframe_every=50, split=SMALLEST
    )
    damaged: list[bytes] = []
    restarts: list[Restart] = []
    stop = asyncio.Event()

    def damage(tick: int) -> None:
        if not damaged and (found := part_paths(log)).keys() > {0, 1}:
            # The first has its end by now, and is not what it says it is.
            content = bytearray(found[0].read_bytes())
            content[len(content) // 2] ^= 1
            found[0].write_bytes(content)
            damaged.append(bytes(content))
            for one in parts():
                if one.name() == "world":
                    one.send_signal(signal.SIGKILL)
        elif restarts and tick > restarts[0].tick:
            stop.set()

    outcome = asyncio.run(
        run_with_restarts(
            options,
            log,
            stop,
            Supervision(),
            on_progress=damage,
            on_restart=restarts.append,
        )
    )
    assert not outcome.complete
    assert damaged[0] in [path.read_bytes() for path in tmp_path.iterdir()]


ELSEWHERE = (1, 3)  # cells
SWARM = "demo"


def endpoint() -> str:
    """Where a hub may listen now."""
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.mark.parametrize(
    "victims",
    [("coordinator",), ("cell/1",), ("cell/0",), ("hub",), ("recorder", "cell/3")],
    ids="+".join,
)
def test_a_run_with_cells_elsewhere_comes_to_the_same(
    victims: tuple[str, ...], tmp_path: Path
) -> None:
    options = options_for(ENDLESS)
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed, served, where = Disturbed(options, log), list[Served](), endpoint()

    async def both() -> Outcome:
        async with asyncio.TaskGroup() as group:
            group.create_task(
                serve(
                    remote_parts.cells(ELSEWHERE),
                    Network(connect=where),
                    SWARM,
                    asyncio.Event(),
                    on_served=served.append,
                )
            )
            return await disturbed.running(
                (20, victims),
                (20, victims),
                network=Network(listen=where),
                swarm=SWARM,
                elsewhere=frozenset(f"cell/{cell}" for cell in ELSEWHERE),
            )

    outcome = asyncio.run(both())
    check_same(outcome, disturbed, log, options, calm)
    assert [one.swarm for one in served] == ["demo", "demo-1", "demo-2"]
    assert [bool(one.trouble) for one in served] == [True, True, False]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]


def test_a_run_that_dies_too_often_is_given_up(tmp_path: Path) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(ENDLESS), log, max_restarts=1)
    with pytest.raises(PartDiedError, match=r"^world: must not end before"):
        disturbed.run((20, ("world",)), (20, ("world",)))
    assert len(disturbed.restarts) == 1
    assert verify(log).ticks >= disturbed.flushed[-1] - 1 > disturbed.restarts[0].tick


def test_a_run_is_not_continued_unless_wanted(tmp_path: Path) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(ENDLESS), log, restart="never")
    with pytest.raises(PartDiedError, match=r"^cell/0: must not end before"):
        disturbed.run((20, ("cell/0",)))
    assert not disturbed.restarts
    assert verify(log).ticks >= disturbed.flushed[0] - 1 > 0


def test_a_run_given_up_before_a_tick_of_its_own_keeps_what_there_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(ENDLESS), log, max_restarts=2)
    start = Supervisor.start

    # Once it goes on, its hub dies before there is a coordinator: nothing is recorded.
    async def started(self: Supervisor, job: Job, connection: PartConnection) -> Child:
        child = await start(self, job, connection)
        if connection.who == "recorder" and disturbed.restarts:
            (hub,) = [one for one in parts() if one.name() == "hub"]
            hub.send_signal(signal.SIGKILL)
        return child

    monkeypatch.setattr(Supervisor, "start", started)
    with pytest.raises(PartDiedError, match=r"^hub: must not end before"):
        disturbed.run((20, ("world",)))
    first, second = disturbed.restarts
    assert first.tick == second.tick > 0
    assert verify(log).ticks == first.tick
    assert list(tmp_path.iterdir()) == [log]


NO_RECORDING = b"no recording" * 9  # shorter, it could hold no tick


def recorded(path: Path, ticks: int) -> Path:
    options = msgspec.structs.replace(options_for(ticks), cells="inline")
    asyncio.run(run(options, path, asyncio.Event()))
    return path


@pytest.mark.parametrize(
    ("after", "before", "kept"),
    [(9, 5, 9), (5, 9, 9), (6, 6, 6), (None, 4, 4), (-1, 4, 4), (3, -1, 3)],
)
def test_of_two_recordings_the_further_stays(
    after: int | None, before: int, kept: int, tmp_path: Path
) -> None:
    log, broken = tmp_path / "log", tmp_path / "log.broken"
    for path, ticks in ((log, after), (broken, before)):
        if ticks is not None and ticks > 0:
            recorded(path, ticks)
        elif ticks is not None:
            path.write_bytes(NO_RECORDING)
    RestartFiles(log).keep_furthest()
    assert verify(log).ticks == kept
    # What cannot be read is not deleted: nobody knows what is in it.
    aside = {path.read_bytes() for path in tmp_path.iterdir() if path != log}
    assert aside == ({NO_RECORDING} if -1 in (after, before) else set())


@pytest.mark.parametrize("ticks", [1, 2, 12])
def test_a_run_that_dies_past_its_last_tick_does_that_again_and_ends(
    ticks: int, tmp_path: Path
) -> None:
    options = msgspec.structs.replace(options_for(ticks), cells="inline")
    log, again = tmp_path / "a.mcap", tmp_path / "b.mcap"
    asyncio.run(run(options, log, asyncio.Event()))
    past = RestartFiles(log).furthest(options)
    assert (0 if past is None else past.tick) == ticks - 1
    outcome = asyncio.run(run(options, again, asyncio.Event(), past=past))
    assert outcome.totals.ticks == ticks
    verdict = verify(again)
    assert (verdict.same, verdict.ticks) == (True, ticks)


def test_a_recording_alone_is_left_alone(tmp_path: Path) -> None:
    log = recorded(tmp_path / "log", 3)
    content = log.read_bytes()
    RestartFiles(log).keep_furthest()
    assert log.read_bytes() == content


def test_what_an_earlier_run_left_is_not_overwritten(tmp_path: Path) -> None:
    left = tmp_path / "log.broken"
    left.write_bytes(b"all there is")
    rule = "log: must be taken away first: a run left it that was cut short"
    with pytest.raises(InvalidValueError, match=rule):
        Disturbed(options_for(5), tmp_path / "log").run()
    assert left.read_bytes() == b"all there is"


def ending_world(folder: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> RunOptions:
    """Return a run whose world does as `end` says, a statement, after tick 6."""
    (folder / "ending.py").write_text(f"""
import threading

import gymnasium
import numpy as np


class Ending(gymnasium.Env):
    observation_space = gymnasium.spaces.MultiBinary(3)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return np.zeros(3, np.int8), {{}}

    def step(self, action):
        self.steps += 1
        if self.steps > 5:
            {end}
        return np.array([self.steps % 2, 0, 1], np.int8), 0.0, False, False, {{}}


gymnasium.register("test/Ending-v0", Ending, disable_env_checker=True)
""")
    monkeypatch.syspath_prepend(folder)
    # Another test's may be known by that name.
    monkeypatch.delitem(sys.modules, "ending", raising=False)
    gymnasium.registry.pop("test/Ending-v0", None)
    name = "ending:test/Ending-v0"
    source = open_source(name, 1)
    source.close()
    return RunOptions(source=name, body=body_of(source, "walker"), ticks=50)


@pytest.mark.parametrize(("restart", "times"), [("on-failure", 0), ("always", 2)])
def test_who_says_why_it_cannot_go_on_is_started_again_only_if_wanted(
    restart: str, times: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail = 'raise RuntimeError("the sensors are off")'
    options = ending_world(tmp_path, monkeypatch, fail)
    log = tmp_path / "log"
    disturbed = Disturbed(options, log, restart=restart, max_restarts=2)
    with pytest.raises(SwarmError, match="the sensors are off") as raised:
        disturbed.run()
    assert not isinstance(raised.value, PartDiedError)
    assert [event.tick for event in disturbed.restarts] == [6] * times
    assert verify(log).ticks == 6


SILENT = r"^coordinator: world: must answer the decision of tick 6 within 3 s, got no"


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunOptions:
    """A run whose world is there and says no more after tick 6."""
    options = ending_world(tmp_path, monkeypatch, "threading.Event().wait()")
    return msgspec.structs.replace(options, deadline=1.0)


@pytest.mark.parametrize(("restart", "times"), [("never", 0), ("on-failure", 1)])
def test_a_world_that_hangs_is_named_and_treated_like_one_that_died(
    restart: str, times: int, hanging: RunOptions, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(hanging, log, restart=restart, max_restarts=1)
    with pytest.raises(PartDiedError, match=SILENT):
        disturbed.run()
    assert [event.tick for event in disturbed.restarts] == [6] * times
    assert verify(log).ticks == 6


def test_a_run_whose_world_is_held_goes_on_with_another(tmp_path: Path) -> None:
    options = msgspec.structs.replace(options_for(ENDLESS), deadline=1.0)
    held: list[psutil.Process] = []
    restarts: list[Restart] = []
    stop = asyncio.Event()

    def hold(tick: int) -> None:
        if not held and tick > 50:
            held.extend(one for one in parts() if one.name() == "world")
            held[0].send_signal(signal.SIGSTOP)
        elif restarts and tick > restarts[0].tick:
            stop.set()

    log = tmp_path / "log"
    running = run_with_restarts(
        options,
        log,
        stop,
        Supervision(),
        on_progress=hold,
        on_restart=restarts.append,
    )
    outcome = asyncio.run(running)
    said = r"^coordinator: world: must answer the decision of tick \d+ within 3 s"
    assert re.search(said, restarts[0].why)
    assert outcome.restarts == len(restarts)
    verdict = verify(log)
    assert verdict.same
    assert verdict.complete


def test_a_world_elsewhere_that_hangs_is_named(
    hanging: RunOptions, tmp_path: Path
) -> None:
    where, stop = endpoint(), asyncio.Event()

    async def elsewhere() -> None:
        world, network = remote_parts.world(hanging.source), Network(connect=where)
        with contextlib.suppress(SwarmError):  # it will not end when it is asked to
            await serve(world, network, SWARM, stop, restart="never")

    async def both() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(elsewhere())
            try:
                await Disturbed(hanging, tmp_path / "log", restart="never").running(
                    network=Network(listen=where),
                    swarm=SWARM,
                    elsewhere=frozenset({"world"}),
                )
            finally:
                stop.set()

    with pytest.raises(ExceptionGroup) as raised:
        asyncio.run(both())
    (error,) = raised.value.exceptions
    assert isinstance(error, SwarmError)
    assert re.search(SILENT, str(error))


def test_a_short_soak(tmp_path: Path) -> None:
    every = len(SERVICES) + 1
    kills = every + every * (every - 1) // 2
    found = asyncio.run(soak(options_for(1), kills, 7, tmp_path))
    assert found.fine, found
    assert found.restarts >= kills == len(found.killings)
    # Each role once, and each pair.
    assert set(found.killed.values()) == {1}
    assert len(found.killed) == kills


def test_a_short_soak_of_a_run_that_is_fed_lines(tmp_path: Path) -> None:
    # This seed leaves the intake alone, whose death may cost what it has just read.
    found = asyncio.run(soak_outside("worker", 1, 25, tmp_path, rate=50.0))
    assert found.fine, found
    assert found.killed == {"recorder+world": 1}
    assert found.restarts >= 1
    assert found.fed is not None
    assert found.fed.lines == found.ticks > 0
