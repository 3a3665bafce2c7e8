"""Puts a snapshot and a history into a key-frame, and into bands if they are large."""

from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter

import msgspec

from neurosnap import wire
from neurosnap.poc.learning.pairs import pairs_of
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.poc.learning.snapshot_bands import (
    Stretch,
    count_of,
    head_of,
    joined,
    stretches_of,
)

_HISTORY = "history"
_NUMBER = 8  # bytes that one of a band takes


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
    if len(frame.history) > _NUMBER * most:
        data = memoryview(frame.history)
        frame = msgspec.structs.replace(frame, history=b"")
        for place in range(0, len(data), _NUMBER * most):
            cut = data[place : place + _NUMBER * most]
            bands.append(wire.Band(who, frame.tick, _HISTORY, place, cut))
    if shares:
        head, several = head_of(snapshot), count_of(snapshot, most, shares)
    elif snapshot.pairs <= most:
        head = snapshot.to_bytes()
    else:
        head = head_of(snapshot)
        bands += bands_of(snapshot, frame.tick, most, who)
    several += len(bands)
    yield msgspec.structs.replace(frame, snapshot=head, bands=several)
    yield from bands


def bands_of(
    snapshot: Snapshot, tick: int, most: int, who: str, shares: Sequence[range] = ()
) -> Iterator[wire.Band]:
    """Yield the bands of a key-frame; see `stretches_of`."""
    for part in stretches_of(snapshot, most, shares):
        yield wire.Band(who, tick, part.array, part.offset, part.data)


def snapshot_of(frame: wire.KeyFrame, bands: Iterable[wire.Band] = ()) -> Snapshot:
    """Return the snapshot in a key-frame and the bands that belong to it.

    Raises:
        InvalidValueError: They make none.
    """
    own = [band for band in bands if band.array in OF_PAIRS]
    if not own:
        return Snapshot.from_bytes(frame.snapshot)
    return joined(frame.snapshot, map(_stretch, own))


def history_of(frame: wire.KeyFrame, bands: Iterable[wire.Band]) -> bytes:
    """Return the history in a key-frame, or in the bands that belong to it."""
    own = [band for band in bands if band.array == _HISTORY]
    own.sort(key=attrgetter("offset"))
    return frame.history or b"".join(band.data for band in own)


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
    every = len(pairs_of(range(len(order.sensorium))))
    for share in shares:
        pairs = pairs_of(share)
        own = (one for one in bands if one.offset % max(1, every) in pairs)
        order.draw_share(joined(frame.snapshot, map(_stretch, own), share))
    return order


def _stretch(band: wire.Band) -> Stretch:
    return Stretch(band.array, band.offset, band.data)
