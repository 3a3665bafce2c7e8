"""A run that dies too often is abandoned; a hung world counts as dead."""

import asyncio
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import NeurosnapError, PartDiedError, SwarmError
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run_with_restarts import run
from tests.support.disturbed_runs import ENDLESS, Disturbed, options_for
from tests.support.hanging_worlds import SILENT, ending_world
from tests.support.recorded_messages import of_type

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


@pytest.mark.parametrize(("wanted", "times"), [(False, 0), (True, 2)])
def test_who_says_why_it_cannot_go_on_is_started_again_only_if_wanted(
    wanted: bool, times: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail = 'raise RuntimeError("the sensors are off")'
    options = ending_world(tmp_path, monkeypatch, fail)
    log = tmp_path / "log"
    disturbed = Disturbed(options, log, restart_on_error=wanted, max_restarts=2)
    with pytest.raises(SwarmError, match="the sensors are off") as raised:
        disturbed.run()
    assert not isinstance(raised.value, PartDiedError)
    assert [event.tick for event in disturbed.restarts] == [6] * times
    assert verify(log).ticks == 6


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
    ids=["raises", "reads too much"],
)
def test_a_world_that_fails_on_the_way_is_named(
    end: str,
    expected: str,
    cells: CellKind,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options, log = ending_world(tmp_path, monkeypatch, end), tmp_path / "log"
    options = msgspec.structs.replace(options, cells=cells)
    with pytest.raises(NeurosnapError, match=expected):
        asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    assert [state.tick for state in of_type(log, wire.State)] == [1, 2, 3, 4, 5, 6]
    assert [fault.who for fault in of_type(log, wire.Fault)] == ["world"]


# A world that hangs -------------------------------------------------------------------


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunOptions:
    """A run whose world is there and says no more after tick 6."""
    options = ending_world(tmp_path, monkeypatch, "threading.Event().wait()")
    return msgspec.structs.replace(options, deadline=1.0)


def test_a_world_that_hangs_is_named_and_treated_like_one_that_died(
    hanging: RunOptions, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(hanging, log, max_restarts=1)
    with pytest.raises(PartDiedError, match=SILENT):
        disturbed.run()
    assert [event.tick for event in disturbed.restarts] == [6]
    assert verify(log).ticks == 6
