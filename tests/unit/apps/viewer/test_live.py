"""The updates sent for a growing recording add up to its content."""

from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.viewer.api import Event, Frame
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import _PageListener
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.recorded_runs import TICKS, planner_run, recorded

TOLD = 12  # the tick whose state alone is there at first
MOST = 10  # frames in one event that were not told before


def taken(frames: dict[int, Frame], event: Event | None) -> None:
    """Take an event's frames in, as the page does."""
    assert event is not None
    frames.update({frame.tick: frame for frame in event.frames})


@pytest.mark.slow
def test_the_last_frame_that_was_told_is_told_again_once_it_is_whole(
    tmp_path: Path,
) -> None:
    recording = Recording.open(recorded(planner_run(), tmp_path / "run.mcap"))
    log = tmp_path / "growing.mcap"
    frames = dict[int, Frame]()
    with Writer(log) as writer:
        writer.start(recording.metadata)
        messages = recording.messages()
        for each in messages:
            writer.add(each.delivery, each.log_time)
            if isinstance(each.message, wire.State) and each.message.tick == TOLD:
                break
        writer.flush()
        run_view, listener = RunView(log), _PageListener()
        taken(frames, listener.event(run_view, live=True))
        assert [frame.action for frame in frames.values()] == [None]
        for each in messages:
            writer.add(each.delivery, each.log_time)
        writer.finish({}, recording.noted().expected)
    assert run_view.grow()
    taken(frames, listener.event(run_view, live=True))
    whole = RunView(recording.path)
    newest = whole.frames(TICKS - MOST + 1, TICKS)
    assert list(frames.values()) == [*whole.frames(TOLD, TOLD), *newest]
    assert frames[TOLD].action is not None
