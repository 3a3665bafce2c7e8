"""A frame told as a difference is the same frame once it is put together again."""

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.viewer.api import Frame, Wave
from neurosnap.apps.viewer.frame_changes import Change, difference

BITS = st.lists(st.sampled_from([0, 1, None]), min_size=3, max_size=3)
WAVES = st.builds(
    Wave,
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
    change = msgspec.json.decode(payload, type=Change)
    fields = msgspec.json.decode(payload)
    after = fields.pop("after")
    assert change.after == after == (0 if before is None else before.tick)
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
