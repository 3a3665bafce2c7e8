"""Cuts a large snapshot into messages of bounded size, and joins them.

What grows with the square of the sensors are the arrays with a number a pair. In the
*head* they are there, and empty; their numbers are in *bands*, stretches of one array.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.archive import Arrays, entry, rows_in, unpack_arrays
from neurosnap.poc.learning.graph_kernels import place_of
from neurosnap.poc.learning.pairs import pairs_of
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.poc.learning.twins import Twins


class Stretch(NamedTuple):
    """A stretch of the numbers of one array."""

    array: str
    """Its name."""
    offset: int
    """Which they are: the number of the first pair of sensors that is of the share, and
    how far they are behind its first number; in each further row of the array, as many
    more as there are pairs of sensors."""
    data: memoryview
    """The numbers, little-endian."""


def head_of(snapshot: Snapshot) -> bytes:
    """Return the archive of a snapshot, with nothing of its pairs."""
    return snapshot.packed(snapshot.head())


def stretches_of(snapshot: Snapshot, most: int) -> Iterator[Stretch]:
    """Yield the stretches that the head lacks, as views of memory where that can be.

    Args:
        snapshot: Must not change before the last of them was used. One that has a share
            of the pairs yields what is in there.
        most: Numbers in one, at most.
    """
    arrays, every = snapshot.arrays(), _every(len(snapshot.sensorium))
    begin = pairs_of(snapshot.share).start
    for name in OF_PAIRS:
        part = arrays.get(name, np.zeros(0))
        for row, numbers in enumerate(part.reshape((-1, part.shape[-1] or 1))):
            for place in range(0, numbers.size, most):
                some = numbers[place : place + most]
                little = some.astype(some.dtype.newbyteorder("<"), copy=False)
                offset = row * every + begin + place
                yield Stretch(name, offset, little.data.cast("B"))


def _every(sensors: int) -> int:
    """Return by how much the offsets of two rows of an array differ, in any share."""
    return max(1, len(pairs_of(range(sensors))))


def is_of_share(offset: int, share: range, sensors: int) -> bool:
    """Return whether a stretch with an offset is of a share of the pairs of sensors."""
    return offset % _every(sensors) in pairs_of(share)


def count_of(snapshot: Snapshot, most: int, shares: Sequence[range]) -> int:
    """Return how many stretches all who share the learning yield; see `stretches_of`.

    The snapshot is that of any of them, or has no pairs.
    """
    arrays = snapshot.head()
    pieces = sum(-(-_pairs_in(arrays, share) // most) for share in shares)
    return pieces * sum(math.prod(one.shape[:-1]) for _, one in _of_pairs(arrays))


def lacking(head: bytes, share: range) -> int:
    """Return how many bytes a head lacks: the numbers of pairs that are of a share.

    Raises:
        InvalidValueError: It is no head.
    """
    arrays = _arrays_in(head)
    with Snapshot.reading("bands"):
        return _pairs_in(arrays, share) * sum(
            math.prod(one.shape[:-1]) * one.itemsize for _, one in _of_pairs(arrays)
        )


def _of_pairs(arrays: Arrays) -> list[tuple[str, NDArray[Any]]]:
    """Return the arrays of pairs that there are, with their names."""
    return [(name, arrays[name]) for name in OF_PAIRS if name in arrays]


def _pairs_in(arrays: Arrays, share: range) -> int:
    """Return of how many pairs a share has numbers: twins have them in common."""
    own, before = len(share), share.start
    if "twins" in arrays:
        of = entry(arrays, "twins", (rows_in(arrays, "names"),), np.int32)
        own = np.unique(of[share.start : share.stop]).size
        before = np.unique(of[: share.start]).size
    return own * before + own * (own - 1) // 2


def joined(
    head: bytes, stretches: Iterable[Stretch], share: range | None = None
) -> Snapshot:
    """Return the snapshot that was cut.

    Args:
        head: From `head_of`.
        stretches: From `stretches_of`, in any order, all of them.
        share: Of which sensors the snapshot is to have the pairs, and the stretches
            are; if None, all.

    Raises:
        InvalidValueError: They make no snapshot.
    """
    arrays = _arrays_in(head)
    with Snapshot.reading("bands"):
        _fill(arrays, stretches, share)
        return Snapshot.kind_of(arrays).from_arrays(arrays, share)


def _arrays_in(head: bytes) -> Arrays:
    """Return the arrays of a head."""
    with Snapshot.reading("bands"):
        return unpack_arrays(head)


def assembled(head: bytes, shared: Iterable[Snapshot]) -> Snapshot:
    """Return the snapshot of all pairs from those that share them.

    Args:
        head: Theirs.
        shared: They, each just joined.

    Raises:
        InvalidValueError: They make no snapshot.
    """
    arrays = _arrays_in(head)
    with Snapshot.reading("bands"):
        count = rows_in(arrays, "names")
        heads = Twins(arrays.get("twins", np.arange(count)).astype(np.int64)).heads
        pairs = _pairs_in(arrays, range(count))
        for name, empty in _of_pairs(arrays):
            arrays[name] = np.empty((*empty.shape[:-1], pairs), empty.dtype)
        for share in shared:
            theirs = share.arrays()
            for _, former, places in share.twins.places_of(heads):
                row = place_of(len(former), 0)
                for name, all_ in _of_pairs(arrays):
                    all_[..., row : row + len(former)] = theirs[name][..., places]
        return Snapshot.kind_of(arrays).from_arrays(arrays)


def _fill(arrays: Arrays, stretches: Iterable[Stretch], share: range | None) -> None:
    """Put the numbers of pairs where they belong."""
    count = rows_in(arrays, "names")
    share = range(count) if share is None else share
    pairs, every, begin = _pairs_in(arrays, share), _every(count), pairs_of(share).start
    for name, empty in _of_pairs(arrays):
        if empty.ndim > 2 or empty.size or empty.dtype.hasobject:
            raise ValueError(f"{name}: must be empty in the head")
        arrays[name] = np.zeros((*empty.shape[:-1], pairs), empty.dtype)
    filled: dict[str, list[tuple[int, int]]] = {
        name: [] for name, _ in _of_pairs(arrays) if pairs
    }
    for name, offset, data in stretches:
        if name not in filled:
            raise ValueError(f"{name:.40}: must be of pairs, and in the head")
        flat = arrays[name].reshape(-1)
        numbers = np.frombuffer(data, flat.dtype.newbyteorder("<"))
        row, place = divmod(offset - begin, every)
        if row < 0 or place + numbers.size > pairs or row * pairs >= flat.size:
            raise ValueError(f"{name}: must have {pairs} numbers in a row, got more")
        place += row * pairs
        flat[place : place + numbers.size] = numbers
        filled[name].append((place, place + numbers.size))
    for name, spans in filled.items():
        spans.sort()
        begins, ends = [0, *(end for _, end in spans)], [b for b, _ in spans]
        if begins != [*ends, arrays[name].size]:
            raise ValueError(f"{name}: must be there once from its start to its end")
