"""Large key-frames arrive complete or not at all; only they are split."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.zenoh.large_messages import LARGEST, Assembly, pieces
from neurosnap.protocol.key_frames import with_snapshot
from neurosnap.protocol.run_options import RunOptions, SnapshotKind

PREFIX = "neurosnap/one/"
LARGE = bytes(range(256)) * (LARGEST // 100)  # of three pieces, and a rest


@dataclass
class Bytes:
    content: bytes

    def to_bytes(self) -> bytes:
        return self.content


class Sample:
    """As much of Zenoh's as is looked at."""

    def __init__(self, key: str, put: tuple[bytes, bytes]) -> None:
        self.key_expr = PREFIX + key
        self.payload, self.attachment = map(Bytes, put)


def sent(payload: bytes, key: str = "keyframe", number: int = 7) -> list[Any]:
    delivery = wire.Delivery(key, number, 9, payload)
    return [Sample(key, put) for put in pieces(delivery)]


def taken(samples: list[Any]) -> list[wire.Delivery]:
    receive = Assembly(len(PREFIX)).receive
    return [one for sample in samples if (one := receive(sample)) is not None]


def test_what_is_large_comes_whole_and_others_may_speak_in_between() -> None:
    (small,) = sent(b"small", "cellreport/cell/3")
    first, *rest = sent(LARGE)
    assert len(rest) > 1
    assert max(len(each.payload.content) for each in (first, *rest)) < LARGEST
    assert taken([first, small, *rest]) == [
        wire.Delivery("cellreport/cell/3", 7, 9, b"small"),
        wire.Delivery("keyframe", 7, 9, LARGE),
    ]


@pytest.mark.parametrize("left_out", [0, 1, 2])
def test_one_that_lacks_a_piece_is_lost_and_the_next_is_not(left_out: int) -> None:
    damaged = sent(LARGE)
    del damaged[left_out]
    later = sent(LARGE, number=8)
    assert [one.sequence for one in taken([*damaged, *later])] == [8]


def test_only_a_key_frame_comes_in_pieces() -> None:
    with pytest.raises(FabricError, match=r"^message on pulse/3/cell/4: must have at"):
        sent(LARGE, "pulse/3/cell/4")
    whole = bytes(LARGEST - (1 << 16))
    assert [one.payload for one in taken(sent(whole, "pulse/3/cell/4"))] == [whole]


def test_what_would_be_larger_than_any_key_frame_is_not_gathered() -> None:
    assembly = Assembly(len(PREFIX))
    for sample in sent(bytes(wire.LARGEST_KEYFRAME + 1)):
        assert assembly.receive(sample) is None
        assert sum(map(len, assembly._parts)) == 0


def options(count: int, snapshot: SnapshotKind = "empirical") -> RunOptions:
    names = tuple(f"a-sensor-of-some-name-{number}" for number in range(count))
    body = Body(own=names, actions=())
    return RunOptions(
        source="readings.csv",
        body=body,
        ticks=1,
        snapshot=snapshot,
        watch=True,
        support=6,
    )


MOST = 43_454


def test_a_run_whose_key_frames_could_not_be_sent_is_refused() -> None:
    options(MOST).check_frame()
    match = rf"^sensors: must be at most {MOST:,}, for a key-frame of 128 MiB, got 9000"
    with pytest.raises(InvalidValueError, match=match):
        options(90000).check_frame()
    with pytest.raises(InvalidValueError, match=r"^sensors: must be at most"):
        options(MOST + 1).check_frame()


@pytest.mark.parametrize("kind", ["empirical", "discounted"])
@pytest.mark.slow
def test_the_largest_key_frame_that_is_allowed_can_be_sent(kind: SnapshotKind) -> None:
    sensors = MOST // 16
    chosen = options(sensors, kind)
    frame = wire.KeyFrame(
        tick=1,
        snapshot=b"",
        waves=1,
        epochs=(1000,) * sensors,
        history=bytes(sensors * wire.HISTORY // 4),
    )
    snapshot = chosen.new_snapshot()
    snapshot.learn(np.ones(sensors, np.bool_), np.arange(sensors) % 2 > 0)
    head, *bands = with_snapshot(frame, snapshot, chosen.band, "coordinator")
    size = len(wire.encode(head))
    assert 0.9 * wire.LARGEST_KEYFRAME < size * 16 <= wire.LARGEST_KEYFRAME
    assert len(bands) > 1
    for band in bands:
        assert len(list(pieces(wire.Delivery(band.key, 1, 1, wire.encode(band))))) == 1
