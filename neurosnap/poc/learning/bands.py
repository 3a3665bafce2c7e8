"""Cuts the archive of a large snapshot into pieces, and joins them.

What grows with the square of the sensors are the arrays with a number a pair. In the
*head* they are there, and empty; their numbers are in *bands*, stretches of one array.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.archive import Arrays, rows_in, unpack_arrays
from neurosnap.poc.learning.kinds import Snapshot

OF_PAIRS = ("joints", "squares", "codes", "since")
"""The arrays whose last axis is the pairs."""


class Stretch(NamedTuple):
    """Some of the numbers of an array."""

    array: str
    """Its name."""
    offset: int
    """Where they begin in the array, row by row, in numbers."""
    data: memoryview
    """The numbers, little-endian."""


def head_of(snapshot: Snapshot) -> bytes:
    """Return the archive of a snapshot, with nothing of its pairs."""
    arrays = snapshot.arrays()
    empty = {name: arrays[name][..., :0] for name in OF_PAIRS if name in arrays}
    return snapshot.packed(arrays | empty)


def stretches_of(snapshot: Snapshot, most: int) -> Iterator[Stretch]:
    """Yield what the head lacks. They show the snapshot's own memory, and copy nothing.

    Args:
        snapshot: Must not change before the last of them was used.
        most: Numbers in one, at most.
    """
    arrays = snapshot.arrays()
    for name in OF_PAIRS:
        flat = arrays.get(name, np.zeros(0)).reshape(-1)
        for offset in range(0, flat.size, most):
            part = flat[offset : offset + most]
            little = part.astype(part.dtype.newbyteorder("<"), copy=False)
            yield Stretch(name, offset, little.data.cast("B"))


def joined(head: bytes, stretches: Iterable[Stretch]) -> Snapshot:
    """Return the snapshot that was cut.

    Args:
        head: From `head_of`.
        stretches: From `stretches_of`, in any order, all of them.

    Raises:
        InvalidValueError: They make no snapshot.
    """
    try:
        arrays = unpack_arrays(head)
        _fill(arrays, stretches)
    except ValueError as error:
        rule = "must be a Snapshot written by this package"
        raise InvalidValueError("bands", rule, str(error)) from error
    return Snapshot.made_of("bands", arrays)


def _fill(arrays: Arrays, stretches: Iterable[Stretch]) -> None:
    """Put the numbers of pairs where they belong.

    Raises:
        ValueError: One is missing, or there is more than one for a place.
    """
    count = rows_in(arrays, "names")
    pairs = count * (count - 1) // 2
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
        if numbers.size > flat.size - offset:
            raise ValueError(f"{name}: must have {flat.size} numbers, got more")
        flat[offset : offset + numbers.size] = numbers
        filled[name].append((offset, offset + numbers.size))
    for name, spans in filled.items():
        spans.sort()
        begins, ends = [0, *(end for _, end in spans)], [b for b, _ in spans]
        if begins != [*ends, arrays[name].size]:
            raise ValueError(f"{name}: must be there once from its start to its end")
