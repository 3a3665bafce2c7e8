"""No key-frame is larger than a message may be: a large one is cut into bands."""

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.protocol.key_frames import snapshot_of, whole, with_snapshot
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


@pytest.mark.parametrize("ticks", [0, 9])
def test_what_is_long_is_put_together_from_its_bands_in_any_order(ticks: int) -> None:
    """Those of the weights are among them, once there are more pairs than in a band."""
    snapshot, history = options(5).new_snapshot(), bytes(range(256)) * (1 << 16)
    for last in range(ticks):
        snapshot.learn(np.arange(5) <= last % 5)
    frame = wire.KeyFrame(ticks, b"", 1, agent=b"short", history=history)
    head, *bands = with_snapshot(frame, snapshot, 4, "coordinator")
    assert isinstance(head, wire.KeyFrame)
    assert (head.agent, head.history) == (b"short", b"")
    assert head.bands == len(bands)
    every = [band for band in bands[::-1] if isinstance(band, wire.Band)]
    assert {len(band.data) for band in every if band.array == "history"} == {1 << 23}
    again = whole(head, every)
    assert (again.agent, again.history) == (b"short", history)
    assert snapshot_of(again, every).to_bytes() == snapshot.to_bytes()
    assert whole(frame, ()) == frame
