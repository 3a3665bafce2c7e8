"""A run that dies too often, or is not to go on, is given up."""

import signal
from pathlib import Path

import pytest

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.recording.replay.resume import whole_ticks
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.parts.job import Job, PartConnection
from neurosnap.runtime.supervisor import RunningPart, Supervisor
from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    options_for,
    parts,
)
from tests.support.hanging_worlds import ending_world

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


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
    async def started(
        self: Supervisor, job: Job, connection: PartConnection
    ) -> RunningPart:
        part = await start(self, job, connection)
        if connection.who == "recorder" and disturbed.restarts:
            (hub,) = [one for one in parts() if one.name() == "hub"]
            hub.send_signal(signal.SIGKILL)
        return part

    monkeypatch.setattr(Supervisor, "start", started)
    with pytest.raises(PartDiedError, match=r"^hub: must not end before"):
        disturbed.run((20, ("world",)))
    first, second = disturbed.restarts
    assert first.tick == second.tick > 0
    assert verify(log).ticks == first.tick
    # What the second recorder had begun may have been cut off within its first bytes.
    assert [path for path in tmp_path.iterdir() if whole_ticks(path)] == [log]


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
