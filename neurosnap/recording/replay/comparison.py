"""Compares derived with recorded messages, older versions included."""

import msgspec

from neurosnap import wire
from neurosnap.poc.learning.archive import Arrays, pack_arrays, unpack_arrays
from neurosnap.poc.learning.snapshot import OF_PAIRS
from neurosnap.recording.read.reader import Recorded


def is_same(derived: wire.Message | None, recorded: Recorded) -> bool:
    """Tell whether what was derived is what was recorded.

    A key-frame from before may note less than one of today, but nothing else.
    """
    if derived is None:
        return False
    if wire.encode(derived) == recorded.payload:
        return True
    message = recorded.message
    if not isinstance(derived, wire.KeyFrame) or not isinstance(message, wire.KeyFrame):
        return False
    older = wire.KeyFrame(derived.tick, message.snapshot)
    today = msgspec.structs.replace(derived, snapshot=message.snapshot)
    return message in (older, today) and _notes(derived.snapshot, message.snapshot)


def is_stretch(band: wire.Band, arrays: Arrays) -> bool:
    """Tell whether a band is a stretch of an array of pairs, bit for bit."""
    if band.array not in OF_PAIRS or band.array not in arrays:
        return False
    flat = arrays[band.array].reshape(-1)
    count, rest = divmod(len(band.data), flat.itemsize)
    there = flat[band.offset : band.offset + count]
    little = there.astype(there.dtype.newbyteorder("<"), copy=False)
    return not rest and little.data.cast("B") == band.data


def _notes(snapshot: bytes, older: bytes) -> bool:
    """Tell whether a snapshot holds every array of an older one, bit for bit."""
    try:
        arrays, wanted = unpack_arrays(snapshot), unpack_arrays(older)
    except ValueError:
        return False
    if not wanted.keys() <= arrays.keys():
        return False
    return pack_arrays({name: arrays[name] for name in wanted}) == older
