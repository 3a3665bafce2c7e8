"""A run goes on when a part of it dies, and comes to the same."""

import asyncio
import signal
from collections.abc import Iterator
from pathlib import Path

import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import PartDiedError
from neurosnap.record.reader import Recording
from neurosnap.record.replay import verify
from neurosnap.source import Argument, open_source
from neurosnap.swarm.embody import body_of
from neurosnap.swarm.endure import Restart, run_on
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.run import Outcome, run
from neurosnap.swarm.supervision import Supervision
from tools.soak import VICTIMS, soak

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

PATH = "neurosnap/Path-v0"
SENSORS = 4


@pytest.fixture(autouse=True)
def no_process_is_left() -> Iterator[None]:
    before = set(parts())
    yield
    _, alive = psutil.wait_procs(set(parts()) - before, timeout=5)
    assert not alive


def parts() -> list[psutil.Process]:
    """The parts of swarms of this process; the fork server stays for the next one."""
    kinds = ("hub", "recorder", "coordinator", "world", "cell")
    family = psutil.Process().children(recursive=True)
    return [one for one in family if one.name().partition("/")[0] in kinds]


def options_for(ticks: int) -> RunOptions:
    arguments: dict[str, Argument] = {"places": SENSORS + 1}
    source = open_source(PATH, 3, arguments)
    source.close()
    return RunOptions(
        source=PATH,
        arguments=arguments,
        body=body_of(source, "walker"),
        ticks=ticks,
        seed=3,
    )


class Disturbed:
    """A run of which parts are killed at given ticks."""

    def __init__(self, options: RunOptions, log: Path, **supervision: object) -> None:
        self.restarts: list[Restart] = []
        self._options = options
        self._log = log
        self._supervision = msgspec.convert(
            {"backoff": 0.0, **supervision}, Supervision
        )

    def run(self, *killings: tuple[int, tuple[str, ...]]) -> Outcome:
        """Make the run; at each of the ticks the parts named are killed together."""
        ahead = list(killings)

        def on_progress(tick: int) -> None:
            if ahead and tick >= ahead[0][0]:
                _, victims = ahead.pop(0)
                found = {one.name(): one for one in parts()}
                for victim in victims:
                    found[victim].send_signal(signal.SIGKILL)

        return asyncio.run(
            run_on(
                self._options,
                self._log,
                asyncio.Event(),
                self._supervision,
                on_progress=on_progress,
                on_restart=self.restarts.append,
            )
        )


def course(log: Path) -> list[wire.Message]:
    kinds = (wire.Observation, wire.Decision)
    found: list[wire.Message] = []
    for recorded in Recording.open(log).messages(("observe", "state", "decide")):
        message = recorded.message
        if isinstance(message, wire.State):
            found.append(msgspec.structs.replace(message, wave=1, pulses=0, depth=0))
        elif isinstance(message, kinds):
            found.append(message)
    return found


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
    options = options_for(150)
    calm, log = tmp_path / "calm", tmp_path / "log"
    inline = msgspec.structs.replace(options, cells="inline")
    undisturbed = asyncio.run(run(inline, calm, asyncio.Event()))
    disturbed = Disturbed(options, log)
    outcome = disturbed.run((20, victims), (70, victims))
    assert (outcome.restarts, len(disturbed.restarts)) == (2, 2)
    assert outcome.totals.ticks == undisturbed.totals.ticks == 150
    assert outcome.implications == undisturbed.implications
    assert course(log) == course(calm)
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 150)
    first, second = disturbed.restarts
    assert first.why.startswith(tuple(victims))
    assert first.tick < second.tick
    # What was on its way to the disk is at most a second of ticks.
    assert all(0 <= restart.lost < 400 for restart in disturbed.restarts)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]


def test_a_run_that_dies_too_often_is_given_up(tmp_path: Path) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(5000), log, max_restarts=1)
    with pytest.raises(PartDiedError, match=r"^world: must not end before"):
        disturbed.run((20, ("world",)), (40, ("world",)))
    assert len(disturbed.restarts) == 1
    assert verify(log).ticks >= 20


def test_a_run_is_not_continued_unless_wanted(tmp_path: Path) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(5000), log, restart="never")
    with pytest.raises(PartDiedError, match=r"^cell/0: must not end before"):
        disturbed.run((20, ("cell/0",)))
    assert not disturbed.restarts
    assert verify(log).ticks > 0


@pytest.mark.timeout(150)
def test_a_short_soak(tmp_path: Path) -> None:
    kills = 20
    found = asyncio.run(soak(options_for(60 * kills + 100), kills, 7, tmp_path))
    assert found.equal
    assert found.verified
    assert (found.lost, found.doubled) == (0, 0)
    assert found.kills == kills <= found.restarts
    assert set(found.killed) <= {"cell", *VICTIMS}
    assert len(found.killed) > 2  # not always the same
