"""Puts a snapshot into a key-frame, and into further bands if it is large."""

from collections.abc import Iterable, Iterator, Sequence

import msgspec

from neurosnap import wire
from neurosnap.poc.learning.pairs import pairs_of
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.learning.snapshot_bands import (
    Stretch,
    count_of,
    head_of,
    joined,
    stretches_of,
)


def with_snapshot(
    frame: wire.KeyFrame,
    snapshot: Snapshot,
    most: int,
    who: str,
    shares: Sequence[range] = (),
) -> Iterator[wire.KeyFrame | wire.Band]:
    """Yield a key-frame with its snapshot, and its bands if there are any.

    Args:
        frame: Without a snapshot.
        snapshot: It. It must not change before the last band is on its way.
        most: Numbers of an array in a band, at most; with more pairs than that there
            are bands.
        who: Sends them.
        shares: The sensors of each worker that learns; if there are any, the bands are
            theirs, and they send them.
    """
    if shares:
        head, several = head_of(snapshot), count_of(snapshot, most, shares)
        yield msgspec.structs.replace(frame, snapshot=head, bands=several)
        return
    count = len(snapshot.sensorium)
    if count * (count - 1) // 2 <= most:
        yield msgspec.structs.replace(frame, snapshot=snapshot.to_bytes())
        return
    bands = [*bands_of(snapshot, frame.tick, most, who)]
    head = head_of(snapshot)
    yield msgspec.structs.replace(frame, snapshot=head, bands=len(bands))
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
    if not frame.bands:
        return Snapshot.from_bytes(frame.snapshot)
    return joined(frame.snapshot, map(_stretch, bands))


def order_of(
    frame: wire.KeyFrame, bands: Iterable[wire.Band], shares: Sequence[range]
) -> Snapshot:
    """Return the snapshot in a key-frame with its graph, and without its pairs.

    There is one share of the pairs in memory at a time; each band is of one of them.

    Raises:
        InvalidValueError: They make no snapshot.
    """
    if not frame.bands:
        return Snapshot.from_bytes(frame.snapshot).without_pairs()
    order = joined(frame.snapshot, (), range(0))
    bands, every = [*bands], len(pairs_of(range(len(order.sensorium))))
    for share in shares:
        pairs = pairs_of(share)
        own = (one for one in bands if one.offset % max(1, every) in pairs)
        order.draw_share(joined(frame.snapshot, map(_stretch, own), share))
    return order


def _stretch(band: wire.Band) -> Stretch:
    return Stretch(band.array, band.offset, band.data)
