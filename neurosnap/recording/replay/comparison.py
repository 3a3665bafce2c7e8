"""Compares derived with recorded messages, older versions included."""

import msgspec

from neurosnap import wire
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
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


def _notes(snapshot: bytes, older: bytes) -> bool:
    """Tell whether a snapshot holds every array of an older one, bit for bit."""
    try:
        arrays, wanted = unpack_arrays(snapshot), unpack_arrays(older)
    except ValueError:
        return False
    if not wanted.keys() <= arrays.keys():
        return False
    return pack_arrays({name: arrays[name] for name in wanted}) == older
