"""The snapshot at any tick, learned from the nearest key-frame on."""

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.recording.read.keyframes import Start, starts
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.stretches import last_tick
from neurosnap.recording.replay.learning import Learning


def snapshot_at(recording: Recording, tick: int | None = None) -> tuple[int, Snapshot]:
    """Return a tick and the snapshot after it; its state is left unset.

    Cost: reading every state, beside `learned_at`.

    Args:
        recording: A run's.
        tick: 0 for before the first; None for the last there is, or where messages are
            missing, the last that can be known.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: The recording lacks an observation.
    """
    last = last_tick(recording)
    wanted = last if tick is None else tick
    if not 0 <= wanted <= last:
        raise InvalidValueError("tick", f"must be in [0, {last}]", wanted)
    if tick is None and not recording.whole:
        wanted = _last_known(recording, last)
    return wanted, learned_at(recording, wanted)


def _last_known(recording: Recording, last: int) -> int:
    """Return the last tick up to `last` that can be learned from what is there."""
    frames = {start.frame.tick for start in starts(recording)}
    seen = {
        recorded.message.tick
        for recorded in recording.messages(("observe",))
        if isinstance(recorded.message, wire.Observation)
    }
    known = recording.begins
    for tick in sorted(tick for tick in seen | frames if tick <= last):
        if tick in frames or tick == known + 1:
            known = tick
    return known


def learned_at(recording: Recording, tick: int) -> Snapshot:
    """Return the snapshot after a tick; its state is left unset.

    Cost: learning the ticks since the last key-frame before it, and reading key-frames
    and, from there on, observations; what is in other chunks of a finished recording is
    not unpacked.

    Args:
        recording: A run's.
        tick: One that it holds the state of, or 0.

    Raises:
        RecordingError: The recording is damaged, or lacks an observation.
    """
    learning, since = Learning(recording.path, recording.options), 0
    if (last := _last_frame(recording, tick)) is not None:
        learning.restore(last.frame, last.bands)
        since = last.since
    observations: dict[int, wire.Observation] = {}
    decisions: dict[int, wire.Decision] = {}
    topics = ("observe", "decide") if learning.grows else ("observe",)
    for recorded in recording.messages(topics, start=since):
        match recorded.message:
            case wire.Observation() as observation if (
                learning.tick < observation.tick <= tick
            ):
                observations[observation.tick] = observation
            case wire.Decision() as decision:
                decisions[decision.tick] = decision
            case _:
                pass
    in_order = (observations[each] for each in sorted(observations))
    for _ in learning.learn_to(tick, in_order, decisions):
        pass
    return learning.snapshot


def _last_frame(recording: Recording, tick: int) -> Start | None:
    """Return the last key-frame up to a tick, be it one to start from or not."""
    last: Start | None = None
    for start in starts(recording):
        if (0 if last is None else last.frame.tick) <= start.frame.tick <= tick:
            last = start
    return last
