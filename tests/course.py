"""What happened in a recorded run, for runs that are to come to the same."""

from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.record.whole import open_whole


def course(log: Path) -> list[wire.Message]:
    """Return what was sensed, known and done, without what the schedule decides.

    It is in order of ticks, since senders overtake each other on the way to the file.
    """
    found: list[tuple[int, int, wire.Message]] = []
    for recorded in open_whole(log).messages(("observe", "state", "decide")):
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
    return [message for *_, message in sorted(found, key=lambda each: each[:2])]
