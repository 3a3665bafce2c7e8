"""Go on with a recorded run from its last whole tick.

The new recording starts as a copy of the old one up to that tick and goes on from
there, so it is whole by itself: it replays, and resumes, like any other. What the old
one holds beyond the last whole tick is left out, and so are last words.
"""

from itertools import islice
from pathlib import Path

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.record.past import Past, copied
from neurosnap.record.reader import Recording
from neurosnap.record.replay import DifferenceError, Replay, options_of, resumed_at
from neurosnap.record.sequences import Sequences
from neurosnap.swarm.coordinator import Coordinator
from neurosnap.swarm.options import RunOptions


def look_back(log: Path, most: int | None = None) -> tuple[RunOptions, Past]:
    """Find out where a recorded run can go on.

    Derives the run again on the way: what is resumed is known to be right.

    Args:
        log: Its recording.
        most: Go on from no tick after this one. Whoever goes on with a run as it was
            has to leave its last tick to be done: its end is a part of that.

    Raises:
        RecordingError: There is no whole tick in it, it lacks messages before the last
            one, or it is not the run it says it is.
    """
    recording = Recording.open(log)
    tick = _last_whole_tick(recording, most)
    if tick == 0:
        raise RecordingError(f"{log}: must hold a whole tick to go on from, got none")
    counts = _counts(recording, tick)
    past = Past(
        log=str(log),
        tick=tick,
        actions=_actions(recording, tick),
        state=_state(recording, tick),
        counts=counts,
        resumed=(*resumed_at(recording), tick),
    )
    kept = Sequences()
    for recorded in copied(past):
        kept.receive(recorded.message.sender, recorded.sequence)
    lacking = kept.completeness(counts).missing
    if lacking:
        raise RecordingError(f"{log}: must be whole up to tick {tick}, lacks {lacking}")
    return options_of(recording), past


def _last_whole_tick(recording: Recording, most: int | None) -> int:
    tick = 0
    try:
        for tick in islice(Replay(recording).ticks(), most):  # noqa: B007 - the last
            pass
    except DifferenceError as error:
        raise RecordingError(
            f"{recording.path}: must be a true run: {error}"
        ) from error
    return tick


def _actions(recording: Recording, tick: int) -> tuple[int, ...]:
    """Return the actions decided on at ticks 1 to `tick` - 1."""
    taken = {
        recorded.message.tick: recorded.message.action
        for recorded in recording.messages(("decide",))
        if isinstance(recorded.message, wire.Decision)
    }
    return tuple(taken[before] for before in range(1, tick))


def _state(recording: Recording, tick: int) -> bytes:
    """Return the state of a whole tick."""
    return next(
        recorded.message.literals
        for recorded in recording.messages(("state",))
        if isinstance(recorded.message, wire.State) and recorded.message.tick == tick
    )


def _counts(recording: Recording, tick: int) -> dict[str, int]:
    """Return how many messages of each part belong to the ticks up to `tick`.

    Every part's messages of one tick come before those of the next, so each keeps a
    beginning of its running numbers.
    """
    last_wave = 0
    counts: dict[str, int] = {}
    for recorded in recording.messages(("state", "reach")):
        message = recorded.message
        if isinstance(message, wire.State | wire.Reached) and message.tick <= tick:
            last_wave = max(last_wave, message.wave)
            counts["coordinator"] = recorded.sequence + 1
    topics = ("observe", "excite", "inhibit", "settle", "burst", "tally")
    for recorded in recording.messages(topics):
        message = recorded.message
        belongs = (
            message.tick <= tick
            if isinstance(message, wire.Observation)
            else isinstance(
                message, wire.Pulse | wire.Settled | wire.Burst | wire.Tally
            )
            and message.wave <= last_wave
        )
        if belongs:
            known = counts.get(message.sender, 0)
            counts[message.sender] = max(known, recorded.sequence + 1)
    return counts


def restore(past: Past, ticks: int) -> Coordinator:
    """Return the coordinator's core as it was after the last whole tick.

    Args:
        past: From `look_back`.
        ticks: How many ticks the run is to have in all; more than there are.
    """
    replay = Replay(Recording.open(Path(past.log)))
    for tick in replay.ticks():
        if tick == past.tick:
            break
    replay.core.go_on(ticks)
    return replay.core
