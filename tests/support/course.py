"""What happened in a recorded run, to compare runs that must be equal."""

from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.recording.read.recording import Recording


def course(log: Path, ticks: int | None = None) -> list[wire.Message]:
    """Return what was sensed, known and done, without what the schedule decides.

    It is in order of ticks, since senders overtake each other on the way to the file.

    Args:
        log: A recording.
        ticks: Leave out what comes after the state of this tick: a run that is asked
            to stop may have decided on the next one already, and sensed it.
    """
    found: list[tuple[int, int, wire.Message]] = []
    for recorded in Recording.open(log).messages(("observation", "state", "decision")):
        match recorded.message:
            case wire.Observation(tick=tick) as message:
                found.append((tick, 0, message))
            case wire.State(tick=tick) as state:
                same = msgspec.structs.replace(state, wave=1, pulses=0, depth=0)
                found.append((tick, 1, same))
            case wire.Decision(tick=tick) as message:
                found.append((tick, 2, message))
            case _:
                pass
    found.sort(key=lambda each: each[:2])
    return [
        message
        for tick, kind, message in found
        if ticks is None or (tick, kind) <= (ticks, 1)
    ]
