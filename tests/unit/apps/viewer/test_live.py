"""What is sent of a growing recording leads to what is in it, however late one asks."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.apps.viewer.api import Event, Frame, WaveView
from neurosnap.apps.viewer.live import _PageListener, difference
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.recorded_runs import TICKS, planner_run, recorded

TOLD = 12  # the tick whose state alone is there at first
MOST = 10  # frames in one event that were not told before


def taken(frames: dict[int, Frame], event: Event | None) -> None:
    """Take an event's frames in, as the page does."""
    assert event is not None
    for change in event.frames:
        fields = msgspec.to_builtins(change)
        before = msgspec.to_builtins(frames.get(fields.pop("after")))
        for name in ("bits", "state"):
            old = before[name] if before else []
            told = dict(fields.pop(name, ()))
            fields[name] = [told.get(k, bit) for k, bit in enumerate(old or told)]
        frame = msgspec.convert({**(before or {}), **fields}, Frame)
        frames[frame.tick] = frame


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


BITS = st.lists(st.sampled_from([0, 1, None]), min_size=3, max_size=3)
WAVES = st.builds(
    WaveView,
    wave=st.integers(1, 3),
    kind=st.just("state"),
    signal=st.just([1]),
    hops=st.just([(1, 0)]),
    depth=st.integers(0, 2),
    pulses=st.just(0),
    settled=st.booleans(),
)
FRAMES = st.builds(
    Frame,
    tick=st.integers(1, 4),
    bits=BITS,
    state=BITS,
    contradicted=st.lists(st.integers(0, 2), max_size=2),
    action=st.sampled_from(["go", None]),
    choice=st.integers(-1, 1),
    why=st.sampled_from(["", "so"]),
    begins=st.booleans(),
    incoherent=st.booleans(),
    depth=st.integers(0, 1),
    longest=st.integers(0, 1),
    height=st.integers(0, 1),
    edges=st.integers(0, 1),
    pulses=st.integers(0, 1),
    graph=st.sampled_from(["", "x"]),
    place=st.sampled_from([0, None]),
    waves=st.lists(WAVES, max_size=2),
)


@given(st.none() | FRAMES, FRAMES)
def test_nothing_is_lost_and_nothing_is_told_twice(
    before: Frame | None, now: Frame
) -> None:
    payload = msgspec.json.encode(difference(before, now))
    fields = msgspec.json.decode(payload)
    after = fields.pop("after")
    assert after == (0 if before is None else before.tick)
    was = {} if before is None else msgspec.to_builtins(before)
    for name in ("bits", "state"):
        pairs = fields.pop(name, [])
        if before is not None:
            assert all(was[name][sensor] != value for sensor, value in pairs)
        told = dict(pairs)
        old = was.get(name, [None] * 3)
        fields[name] = [told.get(sensor, old[sensor]) for sensor in range(3)]
    whole = msgspec.json.encode({**was, **fields})
    assert msgspec.json.decode(whole, type=Frame) == now
    told_again = set(fields) - {"tick", "bits", "state"}
    assert all(name not in was or was[name] != fields[name] for name in told_again)
