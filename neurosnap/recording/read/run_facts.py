"""Facts of a recorded run: its options, and where it was resumed."""

import msgspec

from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording


def options_of(recording: Recording) -> RunOptions:
    """Return the options a recorded run was made with.

    Raises:
        RecordingError: The recording says nothing of its run, or nothing valid, or is
            damaged and what it says may be wrong.
    """
    recording.demand_facts()
    try:
        raw = recording.metadata["options"]
        return msgspec.json.decode(raw, type=RunOptions)
    except (KeyError, msgspec.MsgspecError) as error:
        raise RecordingError(
            f"{recording.path}: options: must be those of a run, got {error}"
        ) from error


def resumed_at(recording: Recording) -> tuple[int, ...]:
    """Return the ticks after which a recorded run was taken up again.

    Raises:
        RecordingError: The recording says so in a way that is not valid.
    """
    raw = recording.metadata.get("resumed", "[]")
    try:
        return msgspec.json.decode(raw, type=tuple[int, ...])
    except msgspec.MsgspecError as error:
        raise RecordingError(
            f"{recording.path}: resumed: must be a list of ticks, got {raw!r}"
        ) from error
