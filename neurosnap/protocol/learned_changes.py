"""What a worker's learning changed, as messages.

After the first observation of all, every pair is related in a new way; later, few are.
So rows in which much changes are sent whole, at half a byte a pair, and single pairs
at nine; and whoever takes them in has no more than a piece of it in hand.
"""

from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.poc.learning.snapshot import Changes

PIECE = 1 << 20
"""Bytes of codes in a message, at most, but for a row that has more."""
_SINGLE = 9  # bytes that a single pair takes
Pairs: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8]]
"""``(C,)`` each: the latter sensors of pairs, the former ones, and their codes."""
_CODES = np.array([0, 1, 2, 3, 4, 8, 12], np.uint8)


def pieces_of(
    worker: int, tick: int, changes: Changes | None, most: int = PIECE
) -> list[wire.Learned]:
    """Return what changed; one message at least.

    Args:
        worker: Who learned.
        tick: When.
        changes: What did; None: nothing.
        most: Bytes of codes in a message.
    """
    pieces: list[wire.Learned] = []
    if changes is not None:
        ends = np.cumsum((changes.rows + 1) // 2)
        begin = 0
        while begin < len(ends):
            before = ends[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(ends, before + most, "right")))
            rows = changes.rows[begin:end].astype("<i4").tobytes()
            codes = changes.packed[before : ends[end - 1]].tobytes()
            pieces.append(wire.Learned(worker, tick, rows=rows, codes=codes))
            begin = end
        for place in range(0, len(changes.codes), max(1, most // _SINGLE)):
            cut = slice(place, place + max(1, most // _SINGLE))
            pieces.append(
                wire.Learned(
                    worker,
                    tick,
                    latter=changes.latter[cut].astype("<i4").tobytes(),
                    former=changes.former[cut].astype("<i4").tobytes(),
                    single=changes.codes[cut].tobytes(),
                )
            )
    pieces = pieces or [wire.Learned(worker, tick)]
    return [
        msgspec.structs.replace(piece, part=part, parts=len(pieces))
        for part, piece in enumerate(pieces)
    ]


def pairs_in(message: wire.Learned, share: range) -> Pairs:
    """Return what a message says changed.

    Args:
        message: A worker's.
        share: The sensors whose pairs with those before them the worker has.

    Raises:
        MessageError: It cannot be right.
    """
    rows = _sensors("rows", message.rows)
    latter = _sensors("latter", message.latter)
    former = _sensors("former", message.former)
    single = np.frombuffer(message.single, np.uint8)
    if not len(latter) == len(former) == len(single):
        got = f"{len(latter)}, {len(former)} and {len(single)}"
        raise MessageError(f"learned: must have as many former as latter, got {got}")
    for name, sensors in (("rows", rows), ("latter", latter)):
        beyond = (sensors < share.start) | (sensors >= share.stop)
        if beyond.any():
            rule = f"must be in {share.start} to {share.stop - 1}"
            got = sensors[beyond][0]
            raise MessageError(f"learned: {name} {rule}, got {got}")
    if ((former < 0) | (former >= latter)).any():
        raise MessageError("learned: former must be before latter, got one that is not")
    sizes = (rows + 1) // 2
    if len(message.codes) != sizes.sum():
        rule = f"must be {sizes.sum()} bytes for these rows"
        raise MessageError(f"learned: codes {rule}, got {len(message.codes)}")
    packed = np.frombuffer(message.codes, np.uint8)
    halves = np.stack([packed & 15, packed >> 4], axis=1).reshape(-1)
    # A row with an odd number of pairs ends with half a byte that says nothing.
    ends = 2 * np.cumsum(sizes) - 1
    used = np.ones(halves.size, np.bool_)
    used[ends[rows % 2 == 1]] = False
    codes = np.concatenate([halves[used], single])
    if not np.isin(codes, _CODES).all() or halves[~used].any():
        raise MessageError("learned: codes must be of pairs, got one that is not")
    return (
        np.concatenate([np.repeat(rows, rows), latter]),
        np.concatenate([*map(np.arange, rows), former]),
        codes,
    )


def _sensors(name: str, data: bytes) -> NDArray[np.intp]:
    """Return numbers of sensors.

    Raises:
        MessageError: There is a part of one in it.
    """
    if len(data) % 4:
        rule = "must be four bytes a number"
        raise MessageError(f"learned: {name} {rule}, got {len(data)}")
    return np.frombuffer(data, "<i4").astype(np.intp)
