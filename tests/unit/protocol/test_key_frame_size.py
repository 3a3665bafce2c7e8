"""No key-frame is larger than a message may be: a large one is cut into bands."""

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.key_frames import history_of, snapshot_of, with_snapshot
from neurosnap.protocol.run_options import RunOptions, SnapshotKind


def options(count: int, snapshot: SnapshotKind = "empirical") -> RunOptions:
    names = tuple(f"a-sensor-of-some-name-{number}" for number in range(count))
    body = Body(own=names, actions=())
    return RunOptions(
        source="readings.csv",
        body=body,
        ticks=1,
        snapshot=snapshot,
        threshold="auto" if snapshot == "empirical" else None,
        watch=True,
        support=6,
    )


MOST = 193_158


def test_a_run_whose_key_frames_could_not_be_sent_is_refused() -> None:
    options(MOST).check_frame()
    match = rf"^sensors: must be at most {MOST:,}, for a key-frame of 64 MiB, got 40000"
    with pytest.raises(InvalidValueError, match=match):
        options(400_000).check_frame()
    with pytest.raises(InvalidValueError, match=r"^sensors: must be at most"):
        options(MOST + 1).check_frame()


@pytest.mark.parametrize("kind", ["empirical", "discounted"])
@pytest.mark.slow
def test_the_largest_key_frame_that_is_allowed_can_be_sent(kind: SnapshotKind) -> None:
    sensors = MOST // 64
    chosen = options(sensors, kind)
    frame = wire.KeyFrame(
        tick=1,
        snapshot=b"",
        waves=1,
        epochs=(1000,) * sensors,
        history=bytes(64 * sensors * wire.HISTORY // 4),
    )
    snapshot = chosen.new_snapshot()
    for last in range(9):
        snapshot.learn(np.arange(sensors) <= last)
    head, *bands = with_snapshot(frame, snapshot, chosen.band, "coordinator")
    size = len(wire.encode(head))
    assert 0.4 * wire.LARGEST_KEYFRAME < size * 64 <= wire.LARGEST_KEYFRAME
    assert len(bands) > 1


@pytest.mark.parametrize("ticks", [0, 9])
def test_a_long_history_is_put_together_from_its_bands_in_any_order(ticks: int) -> None:
    """Those of the weights are among them, once there are more pairs than in a band."""
    snapshot, history = options(5).new_snapshot(), bytes(range(250))
    for last in range(ticks):
        snapshot.learn(np.arange(5) <= last % 5)
    frame = wire.KeyFrame(tick=ticks, snapshot=b"", waves=1, epochs=(), history=history)
    head, *bands = with_snapshot(frame, snapshot, 4, "coordinator")
    assert isinstance(head, wire.KeyFrame)
    assert head.history == b""
    assert head.bands == len(bands)
    every = [band for band in bands[::-1] if isinstance(band, wire.Band)]
    assert {len(band.data) for band in every if band.array == "history"} == {32, 26}
    assert history_of(head, every) == history
    assert snapshot_of(head, every).to_bytes() == snapshot.to_bytes()
    assert history_of(frame, ()) == history
