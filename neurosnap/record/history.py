"""What a run had learned at any tick: from the nearest key-frame on."""

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.poc.snapshot import Snapshot
from neurosnap.record.reader import Recording
from neurosnap.record.replay import options_of
from neurosnap.swarm.readings import readings


def last_tick(recording: Recording) -> int:
    """Return the last tick whose state was recorded, 0 if there is none."""
    tick = 0
    for recorded in recording.messages(("state",)):
        if isinstance(recorded.message, wire.State):
            tick = max(tick, recorded.message.tick)
    return tick


def snapshot_at(recording: Recording, tick: int | None = None) -> tuple[int, Snapshot]:
    """Return a tick and the snapshot after it; its state is left unset.

    Cost: the ticks since the last key-frame before it.

    Args:
        recording: A run's.
        tick: 0 for before the first; None for the last.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: The recording is damaged, or lacks an observation.
    """
    last = last_tick(recording)
    wanted = last if tick is None else tick
    if not 0 <= wanted <= last:
        raise InvalidValueError("tick", f"must be in [0, {last}]", wanted)
    options = options_of(recording)
    now, snapshot = 0, options.new_snapshot()
    for recorded in recording.messages(("keyframe",)):
        frame = recorded.message
        if isinstance(frame, wire.KeyFrame) and now <= frame.tick <= wanted:
            now, snapshot = frame.tick, Snapshot.from_bytes(frame.snapshot)
    observations = {
        recorded.message.tick: recorded.message
        for recorded in recording.messages(("observe",))
        if isinstance(recorded.message, wire.Observation)
        and now < recorded.message.tick <= wanted
    }
    for following in range(now + 1, wanted + 1):
        if following not in observations:
            rule = f"must hold the observation of tick {following}"
            raise RecordingError(f"{recording.path}: {rule}, got none")
        snapshot.learn(*readings(observations[following], len(options.sensors)))
    return wanted, snapshot
