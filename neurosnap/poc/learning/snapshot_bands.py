"""Cuts a large snapshot into messages of bounded size, and joins them.

What grows with the square of the sensors are the arrays with a number a pair. In the
*head* they are there, and empty; their numbers are in *bands*, stretches of one array.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from neurosnap.poc.learning.archive import Arrays, rows_in, unpack_arrays
from neurosnap.poc.learning.pairs import pairs_of
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot


class Stretch(NamedTuple):
    """A stretch of the numbers of one array."""

    array: str
    """Its name."""
    offset: int
    """Where they begin in the array, row by row, in numbers."""
    data: memoryview
    """The numbers, little-endian."""


def head_of(snapshot: Snapshot) -> bytes:
    """Return the archive of a snapshot, with nothing of its pairs."""
    return snapshot.packed(snapshot.head())


def stretches_of(
    snapshot: Snapshot, most: int, shares: Sequence[range] = ()
) -> Iterator[Stretch]:
    """Yield the stretches that the head lacks, as views of the snapshot's own memory.

    Args:
        snapshot: Must not change before the last of them was used. One that has a share
            of the pairs yields what is in there, of others nothing.
        most: Numbers in one, at most.
        shares: The shares that there are, for each stretch to be of one of them.
    """
    arrays, own = snapshot.arrays(), pairs_of(snapshot.share)
    every = len(pairs_of(range(len(snapshot.sensorium))))
    if not shares:
        own = range(own.start, own.start + snapshot.pairs)
    for pairs in map(pairs_of, shares) if shares else (own,):
        if not (own.start <= pairs.start <= pairs.stop <= own.stop):
            continue
        cut = slice(pairs.start - own.start, pairs.stop - own.start)
        for name in OF_PAIRS:
            part = arrays.get(name, np.zeros(0))[..., cut]
            # Where pairs are not shared, the rows of an array are one stretch.
            several = part.reshape(
                (-1, len(pairs)) if shares and len(pairs) else (1, -1)
            )
            for row, numbers in enumerate(several):
                for place in range(0, numbers.size, most):
                    some = numbers[place : place + most]
                    little = some.astype(some.dtype.newbyteorder("<"), copy=False)
                    offset = row * every + pairs.start + place
                    yield Stretch(name, offset, little.data.cast("B"))


def count_of(snapshot: Snapshot, most: int, shares: Sequence[range]) -> int:
    """Return how many stretches all who share the learning yield; see `stretches_of`.

    The snapshot is that of any of them.
    """
    arrays = snapshot.arrays()
    rows = sum(
        math.prod(arrays[name].shape[:-1]) for name in OF_PAIRS if name in arrays
    )
    return rows * sum(-(-len(pairs_of(share)) // most) for share in shares)


def lacking(head: bytes, share: range) -> int:
    """Return how many bytes a head lacks: the numbers of pairs that are of a share.

    Raises:
        InvalidValueError: It is no head.
    """
    arrays = _arrays_in(head)
    return len(pairs_of(share)) * sum(
        math.prod(arrays[name].shape[:-1]) * arrays[name].itemsize
        for name in OF_PAIRS
        if name in arrays
    )


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


def _fill(arrays: Arrays, stretches: Iterable[Stretch], share: range | None) -> None:
    """Put the numbers of pairs where they belong."""
    count = rows_in(arrays, "names")
    if share is None and "twins" in arrays:  # those of a group have one row
        count = int(arrays["twins"].max(initial=-1)) + 1
    every = len(pairs_of(range(count)))
    own = pairs_of(range(count) if share is None else share)
    pairs = len(own)
    for name in OF_PAIRS:
        if name in arrays:
            empty = arrays[name]
            if empty.ndim > 2 or empty.size or empty.dtype.hasobject:
                raise ValueError(f"{name}: must be empty in the head")
            arrays[name] = np.zeros((*empty.shape[:-1], pairs), empty.dtype)
    filled: dict[str, list[tuple[int, int]]] = {
        name: [] for name in OF_PAIRS if name in arrays and pairs
    }
    for name, offset, data in stretches:
        if name not in filled:
            raise ValueError(f"{name:.40}: must be of pairs, and in the head")
        flat = arrays[name].reshape(-1)
        numbers = np.frombuffer(data, flat.dtype.newbyteorder("<"))
        if pairs < every:
            row, place = divmod(offset, every)
            if not own.start <= place <= own.stop - numbers.size:
                raise ValueError(f"{name}: must be of the share")
            offset = row * pairs + place - own.start
        if numbers.size > flat.size - offset:
            raise ValueError(f"{name}: must have {flat.size} numbers, got more")
        flat[offset : offset + numbers.size] = numbers
        filled[name].append((offset, offset + numbers.size))
    for name, spans in filled.items():
        spans.sort()
        begins, ends = [0, *(end for _, end in spans)], [b for b, _ in spans]
        if begins != [*ends, arrays[name].size]:
            raise ValueError(f"{name}: must be there once from its start to its end")
