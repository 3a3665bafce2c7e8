"""Runs end in order on a signal, or with an error that names the failed part."""

import asyncio
import contextlib
import multiprocessing.process
import signal
from collections.abc import Callable
from pathlib import Path

import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import NeurosnapError, SwarmError
from neurosnap.protocol.run_options import CellKind
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run import run
from tests.support.exhaustive import rows
from tests.support.hanging_worlds import ending_world
from tests.support.played_runs import TICKS, Played, options_for, play, write_readings
from tools.soak.signals import Struggle, struggling

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_readings(tmp_path_factory.mktemp("run") / "readings.csv", TICKS)


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return a source of few sensors that no run here comes to the end of."""
    path = tmp_path_factory.mktemp("endless") / "endless.csv"
    return write_readings(path, 20_000, sensors=4)


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
    assert played.recording.cut is None
    assert played.recording.completeness().whole
    ticks = [state.tick for state in played.of(wire.State)]
    assert ticks == list(range(1, played.outcome.totals.ticks + 1))
    assert 5 <= len(ticks) < 20_000
    assert [frame.tick for frame in played.of(wire.KeyFrame)][-1] == ticks[-1]
    assert {leave.who for leave in played.of(wire.Leave)} == {
        "coordinator",
        "world",
        *options.host_names(),
    }


async def test_a_source_that_is_over_ends_the_run_in_order(
    readings: str, tmp_path: Path
) -> None:
    options = options_for(readings, ticks=100_000)
    played = await play(options, tmp_path / "log.mcap")
    assert played.outcome is not None
    assert not played.outcome.stopped
    assert len(played.states) == played.outcome.totals.ticks == TICKS
    assert played.recording.completeness().whole


async def test_a_part_that_dies_ends_the_run_and_is_named(
    endless: str, tmp_path: Path
) -> None:
    who, log = "worker/1", tmp_path / "log.mcap"
    options = options_for(endless, cells="worker", workers=2, ticks=100_000)
    with pytest.raises(SwarmError, match=rf"^(coordinator: )?{who}: must "):
        await run(
            RunRequest(options, log),
            asyncio.Event(),
            Watcher(at(3, lambda: child(who).send_signal(signal.SIGKILL))),
        )
    played = Played(log)
    assert [tick for tick, _, _ in played.states[:3]] == [1, 2, 3]
    assert played.recording.cut is None
    assert who in played.recording.completeness().missing


@pytest.mark.parametrize("cells", ["inline", "process"])
@pytest.mark.parametrize(
    ("end", "expected"),
    [
        (
            'raise OSError("the camera is gone")',
            r"^world: [\s\S]*OSError: the camera is gone",
        ),
        (
            "return np.zeros(4, np.int8), 0.0, False, False, {}",
            r"^(world: )?ending:test/Ending-v0: observation: ",
        ),
    ],
)
async def test_a_world_that_fails_on_the_way_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cells: CellKind,
    end: str,
    expected: str,
) -> None:
    options = ending_world(tmp_path, monkeypatch, end)
    options = msgspec.structs.replace(options, cells=cells)
    log = tmp_path / "log.mcap"
    with pytest.raises(NeurosnapError, match=expected):
        await run(RunRequest(options, log), asyncio.Event())
    played = Played(log)
    assert [tick for tick, _, _ in played.states] == [1, 2, 3, 4, 5, 6]
    (fault,) = played.of(wire.Fault)
    assert fault.who == "world"


async def test_a_full_disk_ends_the_run_and_the_recording_is_named(
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
        await run(
            RunRequest(options, log),
            asyncio.Event(),
            Watcher(at(5, fill, lambda: holds_states(log))),
        )
    assert len(Played(log).states) >= 1


# Signals ------------------------------------------------------------------------------

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
ENDLESS = ("--ticks", 10_000_000, "--set", "places=4")


def under_way(run: Struggle) -> bool:
    return size_of(run) > 30_000


def size_of(run: Struggle) -> int:
    """Return the size of its recording, which a restart may have moved just now."""
    with contextlib.suppress(FileNotFoundError):
        return run.log.stat().st_size
    return 0


def restarting(run: Struggle) -> bool:
    if "going on" in run.said():
        return True
    parts = run.parts()
    if under_way(run) and "cell/2" in parts:
        parts["cell/2"].kill()
    return False


MOMENTS: dict[str, Callable[[Struggle], bool]] = {
    "at the start": Struggle.hears,
    "with the hub": lambda run: "hub" in run.parts(),
    "with the recorder": lambda run: run.log.exists(),
    "with a cell": lambda run: "cell/0" in run.parts(),
    "under way": under_way,
    "in a restart": restarting,
}


@pytest.mark.parametrize(
    ("moment", "number", "group"),
    rows(
        [
            ("at the start", INT, True),
            ("with a cell", TERM, True),
            ("under way", HUP, False),
            ("in a restart", INT, True),
        ],
        [("with the hub", INT, True), ("with the recorder", TERM, True)],
    ),
    ids=str,
)
def test_a_signal_ends_a_run_in_order_at_any_moment(
    moment: str, number: signal.Signals, group: bool
) -> None:
    with struggling(*ENDLESS, "--set", "supervision.backoff=1") as run:
        run.wait_until(lambda: MOMENTS[moment](run))
        run.strike(number, group=group)
        found = run.judge()
    assert found.wrong == []
    if moment == "at the start":
        assert (found.code, found.lines) == (130, ["interrupted"])
    else:
        assert found.code == 0


def test_a_second_signal_while_it_ends_changes_nothing() -> None:
    with struggling(*ENDLESS) as run:
        run.wait_until(lambda: under_way(run))
        run.strike(TERM, group=True)
        run.wait_until(lambda: "coordinator" not in run.parts())
        run.strike(TERM, group=True)
        found = run.judge()
    assert (found.code, found.wrong) == (0, [])


def test_what_is_run_under_nohup_outlives_its_terminal() -> None:
    with struggling(*ENDLESS, ignoring=HUP) as run:
        run.wait_until(lambda: under_way(run))
        run.strike(HUP, group=True)
        size = size_of(run)
        run.wait_until(lambda: size_of(run) > 2 * size)
        assert run.process.poll() is None
        run.strike(TERM, group=True)
        found = run.judge()
    assert (found.code, found.wrong) == (0, [])
