"""Puts a snapshot and a history into a key-frame, and into bands if they are large."""

from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter

import msgspec

from neurosnap import wire
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.poc.learning.snapshot_bands import (
    Stretch,
    assembled,
    count_of,
    head_of,
    is_of_share,
    joined,
    stretches_of,
)

HEAD = "snapshot"
"""The array of a band with bytes of the snapshot in a key-frame."""
_LONG = (HEAD, "agent", "history")
"""What travels in bands where it is long: bytes, in the fields of a key-frame."""
_PIECE = 1 << 23  # bytes of such a field, or in one band of it, at most


def with_snapshot(
    frame: wire.KeyFrame,
    snapshot: Snapshot,
    most: int,
    who: str,
    shares: Sequence[range] = (),
) -> Iterator[wire.KeyFrame | wire.Band]:
    """Yield a key-frame with its snapshot, and its bands if there are any.

    Args:
        frame: Without a snapshot; with its history.
        snapshot: It. It must not change before the last band is on its way.
        most: Numbers of an array in a band, at most; with more pairs than that there
            are bands.
        who: Sends them.
        shares: The sensors of each worker that learns; if there are any, the bands are
            theirs, and they send them.
    """
    bands, several = list[wire.Band](), 0
    if shares:
        head, several = head_of(snapshot), count_of(snapshot, most, shares)
    elif snapshot.pairs <= most:
        head = snapshot.to_bytes()
    else:
        head = head_of(snapshot)
        bands += bands_of(snapshot, frame.tick, most, who)
    frame = msgspec.structs.replace(frame, snapshot=head)
    for name in _LONG:
        data = memoryview(getattr(frame, name))
        # Workers that share the learning begin with the head, too.
        if len(data) > _PIECE or (shares and name == HEAD):
            frame = msgspec.structs.replace(frame, **{name: b""})
            for place in range(0, len(data), _PIECE):
                cut = data[place : place + _PIECE]
                bands.append(wire.Band(who, frame.tick, name, place, cut))
    yield msgspec.structs.replace(frame, bands=several + len(bands))
    yield from bands


def whole(frame: wire.KeyFrame, bands: Iterable[wire.Band]) -> wire.KeyFrame:
    """Return a key-frame with what its bands hold, but for arrays of pairs."""
    held = {name: joined_bytes(name, bands) for name in _LONG}
    return msgspec.structs.replace(frame, **{k: v for k, v in held.items() if v})


def joined_bytes(name: str, bands: Iterable[wire.Band]) -> bytes:
    """Return what the bands hold of a field of a key-frame."""
    own = sorted((b for b in bands if b.array == name), key=attrgetter("offset"))
    return b"".join(band.data for band in own)


def bands_of(snapshot: Snapshot, tick: int, most: int, who: str) -> Iterator[wire.Band]:
    """Yield the bands of a key-frame; see `stretches_of`."""
    for part in stretches_of(snapshot, most):
        yield wire.Band(who, tick, part.array, part.offset, part.data)


def snapshot_of(
    frame: wire.KeyFrame,
    bands: Iterable[wire.Band] = (),
    shares: Sequence[range] = (),
) -> Snapshot:
    """Return the snapshot in a key-frame and the bands that belong to it.

    Args:
        frame: The key-frame.
        bands: All of them, in any order.
        shares: The sensors of each worker, if they learned.

    Raises:
        InvalidValueError: They make none.
    """
    own = [band for band in bands if band.array in OF_PAIRS]
    if shares and own:
        return assembled(frame.snapshot, _shared(frame, own, shares))
    if not own:
        return Snapshot.from_bytes(frame.snapshot)
    return joined(frame.snapshot, map(_stretch, own))


def order_of(
    frame: wire.KeyFrame, bands: Iterable[wire.Band], shares: Sequence[range]
) -> Snapshot:
    """Return the snapshot in a key-frame with its graph, and without its pairs.

    There is one share of the pairs in memory at a time; each band is of one of them.

    Raises:
        InvalidValueError: They make no snapshot.
    """
    bands = [band for band in bands if band.array in OF_PAIRS]
    if not bands:
        return Snapshot.from_bytes(frame.snapshot).without_pairs()
    order = joined(frame.snapshot, (), range(0))
    for share in _shared(frame, bands, shares):
        order.draw_share(share)
    return order


def _shared(
    frame: wire.KeyFrame, bands: Sequence[wire.Band], shares: Sequence[range]
) -> Iterator[Snapshot]:
    """Yield the snapshots that share the pairs, one at a time."""
    for share in filter(len, shares):
        own = (one for one in bands if is_of_share(one.offset, share, shares[-1].stop))
        yield joined(frame.snapshot, map(_stretch, own), share)


def _stretch(band: wire.Band) -> Stretch:
    return Stretch(band.array, band.offset, band.data)
