"""Repeats the learning of a recorded run, tick by tick, from a key-frame or from 0."""

import copy
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Self

from neurosnap import wire
from neurosnap.agent.growth import apply_change
from neurosnap.agent.growth_in_decisions import body_after
from neurosnap.agent.memory import body_in
from neurosnap.errors import InvalidValueError, MessageError, RecordingError, ShapeError
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.protocol.key_frames import snapshot_of
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.replay_starts import starts
from neurosnap.sensorium import unpack_readings


class Learning:
    """The learning of a run up to a tick, without the snapshot's state.

    Args:
        path: The recording, for errors.
        options: The run's.
    """

    def __init__(self, path: Path, options: RunOptions) -> None:
        self._path = path
        self._options = options
        self.tick = 0
        """The last tick learned from; 0: none."""
        self.body = options.body
        """What is sensed after that tick."""
        self.snapshot = options.new_snapshot()
        """What was learned by then; to be changed by this class alone."""
        self.snapshot.assume(options.known_order)

    def copy(self) -> Self:
        """Return another one at the same tick. O(N²) time and memory."""
        other = copy.copy(self)
        other.snapshot = copy.deepcopy(self.snapshot)
        return other

    def restore(self, frame: wire.KeyFrame, bands: Iterable[wire.Band] = ()) -> None:
        """Go to the tick of a key-frame, given with its bands.

        Raises:
            RecordingError: It holds no snapshot, no agent, or one of other sensors.
        """
        place = f"{self._path}: key-frame of tick {frame.tick}"
        try:
            if self.grows:
                self.body = body_in(self._options.body, frame.agent)
        except ValueError as error:
            raise RecordingError(f"{place}: must hold an agent, {error}") from error
        try:
            self.snapshot = snapshot_of(frame, bands, self._options.learning_shares)
            self.snapshot.assume(self._options.known_order)
        except ValueError as error:
            raise RecordingError(f"{place}: must hold a snapshot, {error}") from error
        if tuple(self.snapshot.sensorium) != self.body.sensors:
            found = len(self.snapshot.sensorium)
            raise RecordingError(f"{place}: must be of the run's sensors, got {found}")
        self.tick = frame.tick

    def learn(
        self, observation: wire.Observation, decision: wire.Decision | None = None
    ) -> None:
        """Learn from the observation of the next tick. O(N²/2) time.

        Args:
            observation: The observation.
            decision: The tick's; it says which sensors come or go. None if none does.

        Raises:
            RecordingError: It is of another tick, or of other sensors.
        """
        tick = self.tick + 1
        if observation.tick != tick:
            raise self._lacks(tick)
        place = f"{self._path}: tick {tick}"
        try:
            bits, known = unpack_readings(
                observation.bits, observation.known, self._options.body.count
            )
        except ShapeError as error:
            raise RecordingError(f"{place}: /observation: {error}") from error
        self.snapshot.learn(bits, known)
        self.tick = tick
        if decision is not None and self.grows:
            try:
                body = body_after(self.body, decision)
                apply_change(body, decision, self.snapshot)
            except MessageError as error:
                raise RecordingError(f"{place}: /{error}") from error
            self.body = body

    @property
    def grows(self) -> bool:
        """Whether decisions may say that a sensor comes or goes."""
        return self._options.body.room > 0

    def learn_to(
        self,
        last: int,
        observations: Iterable[wire.Observation],
        decisions: Mapping[int, wire.Decision],
    ) -> Iterator[int]:
        """Learn up to a tick, and yield each tick when it is learned from.

        Args:
            last: The tick; nothing is done if it is not ahead.
            observations: Those of the ticks ahead, in order.
            decisions: Those of the ticks ahead, by tick, if sensors grow.

        Raises:
            RecordingError: While iterating: as `learn`, or one is missing.
        """
        for observation in observations:
            if self.tick >= last:
                return
            self.learn(observation, decisions.get(observation.tick))
            yield self.tick
        if self.tick < last:
            raise self._lacks(self.tick + 1)

    def _lacks(self, tick: int) -> RecordingError:
        rule = f"must hold the observation of tick {tick}"
        return RecordingError(f"{self._path}: {rule}, got none")


def snapshot_at(recording: Recording, tick: int | None = None) -> tuple[int, Snapshot]:
    """Return a tick and the snapshot after it; its state is left unset.

    Cost: as `learned_at`; of a recording that is not whole, reading what was observed.

    Args:
        recording: A run's.
        tick: 0 for before the first; None for the last there is, or where messages are
            missing, the last that can be known.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: The recording lacks an observation.
    """
    last = TickIndex(recording).last_tick()
    wanted = last if tick is None else tick
    if not 0 <= wanted <= last:
        raise InvalidValueError("tick", f"must be in [0, {last}]", wanted)
    if tick is None and not recording.whole:
        wanted = _last_known(recording, last)
    return wanted, learned_at(recording, wanted)


def _last_known(recording: Recording, last: int) -> int:
    """Return the last tick up to `last` that can be learned from what is there."""
    frames = {start.frame.tick for start in starts(recording)}
    seen = {one.tick for one in recording.all("observation", wire.Observation)}
    known = recording.begins
    for tick in sorted(tick for tick in seen | frames if tick <= last):
        if tick in frames or tick == known + 1:
            known = tick
    return known


def learned_at(recording: Recording, tick: int) -> Snapshot:
    """Return the snapshot after a tick; its state is left unset.

    Cost: learning the ticks since the last key-frame before it, and unpacking the
    chunks that these are in.

    Args:
        recording: A run's.
        tick: One that it holds the state of, or 0.

    Raises:
        RecordingError: The recording is damaged, or lacks an observation.
    """
    learning, index = Learning(recording.path, recording.options), TickIndex(recording)
    if (found := index.keyframe(tick)) is not None:
        learning.restore(*found)
    first = learning.tick + 1
    changes = index.changes(first, tick) if learning.grows else {}
    for _ in learning.learn_to(tick, index.observations(first, tick), changes):
        pass
    return learning.snapshot
