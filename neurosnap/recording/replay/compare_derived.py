"""Derives a run again from its observations, and compares it with the recording.

The coordinator's core is a pure function of what it was given. A replay gives it the
recorded observations and the cells' recorded reports, and demands that it says, byte
for byte, what the recording says it said: every wiring, every wave, every state, every
decision. What the agent sensed of its own actions must follow from the decision and the
state before. Beside that, every wave's reports must name exactly what the in-process
propagation over the derived graph reaches, and what cells recalled must be what they
had read: so it is the cells that are checked, and not only the coordinator's
arithmetic.

All of this can begin at any key-frame, which is taken at its word then; one that is
passed on the way is compared like the rest.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.agent_observation import Senses
from neurosnap.errors import NeurosnapError, RecordingError, ShapeError
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.wave_settling import fired
from neurosnap.protocol.worker_learning import WorkerLearning
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.replay_starts import Start, last_start
from neurosnap.sensorium import selection, unpack, unpack_readings

_INPUTS = ("observation", "cellreport", "workerreport", "recalled", "band", "learned")
_OUTPUTS = (
    *("wiring", "workerwiring", "wavestart", "state", "reached", "decision"),
    *("keyframe", "anomaly", "recall", "reminder", "learn"),
)
_SHOWN = 300  # characters of a message shown in a difference
_Key: TypeAlias = tuple[str, int, int]
"""What several recorded messages answer: kind, wave or tick, and round."""


class DifferenceError(NeurosnapError):
    """A derived message differs from the recorded one."""


def start_of(recording: Recording, tick: int = 0) -> Start | None:
    """Return the key-frame where a replay begins; None for the start of the run.

    Args:
        recording: A run's.
        tick: The start is not after it; 0: it is the first there is.

    Raises:
        RecordingError: There is no key-frame to start from, and it does not begin with
            the run.
    """
    first = recording.begins
    start = last_start(recording, max(tick, first))
    if start is None and first:
        raise lacks_key_frame(recording)
    return start if tick or first else None


def lacks_key_frame(recording: Recording) -> RecordingError:
    """Return the error for a file that lacks the key-frame that it begins with."""
    rule = f"must hold the key-frame of tick {recording.begins}"
    return RecordingError(f"{recording.path}: {rule}, got none")


class Replay:
    """A recorded run that is derived again, tick by tick, by iterating over `ticks`.

    Args:
        recording: What to replay.
        start: One of its key-frames, to begin there; None to begin with the run.

    Raises:
        RecordingError: It is not a run's, or the key-frame not one of it.
    """

    def __init__(self, recording: Recording, start: Start | None = None) -> None:
        self.path = recording.path
        self.options = recording.options
        frame, bands = (None, ()) if start is None else (start.frame, start.bands)
        try:
            if frame is None:
                self.core = Coordinator(self.options)
            else:
                self.core = Coordinator.from_key_frame(self.options, frame, bands)
            known = b"" if frame is None else frame.known
            told = unpack(known, self.options.body.count) if known else None
        except ValueError as error:
            raise RecordingError(
                f"{recording.path}: keyframe: must be of this run, got {error}"
            ) from error
        self.workers = _workers(self.options, frame, bands)
        self.first = self.core.tick
        self._start = start
        memory, own = self.core.memory, len(self.options.body.own)
        self._body = memory.body
        told = None if told is None else told[:own]
        self._senses = Senses(memory.body, told, memory.history)
        self.compared = dict.fromkeys(_OUTPUTS, 0)
        self.complete = recording.whole
        self._closing = recording.closing
        self._resumed = deque(t for t in recording.resumed if t > self.first)
        self._messages = recording.messages(
            _INPUTS + _OUTPUTS, start=0 if start is None else start.since
        )
        # Read ahead: senders overtake each other in a recording, too.
        self._outputs: deque[Recorded] = deque()
        self._inputs: dict[_Key, list[wire.Message]] = {}
        self._bands: dict[int, list[wire.Band]] = {}  # by tick
        self._would: list[wire.Learned] = []  # what workers should say of a tick
        self._reached = defaultdict[int, NDArray[np.bool_]](self._nothing_reached)
        self._observed = np.zeros(0, dtype=np.bool_)
        # A key-frame to begin with has been said.
        said = self.core.begin() if frame is None else [self.core.decision]
        if frame is not None and self.workers and self.first in recording.resumed:
            self.core.begin_with(len(frame.snapshot))
        self._said: deque[wire.Message] = deque(said)
        self._under_way = self.first  # the tick of what is derived now
        self._exhausted = False  # read to the end in search of an input

    def ticks(self) -> Iterator[int]:
        """Yield each tick once it is whole: the core is then as it was at that point.

        Whole means that its state and all its waves are compared; its key-frame and
        decision follow. A recording that lacks messages is followed to the first that
        is needed: nothing can be derived beyond, and nothing held against it.

        Raises:
            DifferenceError: What was derived is not what was recorded.
            RecordingError: The recording is damaged.
        """
        tick = self.first
        while self._outputs or self._read_until(lambda: bool(self._outputs)):
            recorded = self._outputs.popleft()
            derived = self._derive(recorded)
            if derived is None and self._exhausted and not self.complete:
                return
            self._compare(recorded, derived)
            if isinstance(derived, wire.KeyFrame):
                self._check_bands(derived)
            if isinstance(derived, wire.Learn):
                self._learn(derived)
            if not self._said:
                self._let_answer()
            if self.core.tick == tick or not self._only_closing_words():
                continue
            tick = self.core.tick
            yield tick
            if self._resumed and self._resumed[0] == tick:
                self._resumed.popleft()
                self._said = deque(self.core.begin())
        self._check_closing(tick)

    def _check_closing(self, tick: int) -> None:
        """Hold the last decision against what the file after this one opens with."""
        closing, derived = self._closing, self.core.decision
        if closing is None or not (self.complete or tick == closing.tick):
            return
        if derived != closing:
            raise DifferenceError(
                f"tick {tick}: the decision of the last tick: recorded {closing},"
                f" derived {derived}"
            )
        self.compared["decision"] += 1

    def _only_closing_words(self) -> bool:
        closing = (wire.KeyFrame, wire.Band, wire.Learn, wire.Decision)
        return all(isinstance(message, closing) for message in self._said)

    # Comparing -----------------------------------------------------------------------

    def _derive(self, recorded: Recorded) -> wire.Message | None:
        """Bring the core to say what it said then; None if it says nothing."""
        message = recorded.message
        if isinstance(message, wire.KeyFrame) and (
            not self._said or isinstance(self._said[0], wire.Decision)
        ):
            # Only the one who asked the run to stop here knew that it would.
            self._said = deque(self.core.stop())
        if not self._said:
            said = self._feed(recorded)
            # Faults were said of what came in bad, which was not always recorded.
            self._said.extend(m for m in said if not isinstance(m, wire.Fault))
        return self._said.popleft() if self._said else None

    def _compare(self, recorded: Recorded, derived: wire.Message | None) -> None:
        """Hold what was derived against what was recorded."""
        message = recorded.message
        if derived is None or wire.encode(derived) != recorded.payload:
            self._differ(recorded, derived)
        match message:
            case wire.State():
                self._check_reached(recorded, message.wave, self._observed)
            case wire.Reached():
                self._check_reached(recorded, message.wave, message.signal)
            case _:
                pass
        self.compared[wire.topic(message.key)] += 1

    def _nothing_reached(self) -> NDArray[np.bool_]:
        return np.zeros(len(self.core.graph), np.bool_)

    def _check_reached(
        self, recorded: Recorded, wave: int, signal: Iterable[int]
    ) -> None:
        """Hold what the cells reported against the propagation in process."""
        above = self.core.graph.up(signal)
        reached = self._reached.pop(wave, self._nothing_reached())
        if not np.array_equal(reached, above):
            raise DifferenceError(
                f"{self._where(recorded)}: cells reported"
                f" {np.flatnonzero(reached).tolist()}, the derived order gives"
                f" {np.flatnonzero(above).tolist()}"
            )

    def _check_bands(self, frame: wire.KeyFrame) -> None:
        """Verify the bands of a key-frame against what was learned.

        One that is lost shows in its sender's numbers.
        """
        sent: Iterable[wire.Band] = self.bands()
        for asked in self._said:  # a sensor may come or go before workers send theirs
            if isinstance(asked, wire.Learn):
                sent = self._learn(asked)
        derived = {(one.array, one.offset): one.data for one in sent}
        while self._said and isinstance(band := self._said[0], wire.Band):
            derived[band.array, band.offset] = band.data
            self._said.popleft()
        if not frame.bands:
            return
        found = self._bands.setdefault(frame.tick, [])
        self._read_until(lambda: len(found) >= frame.bands or self._is_read_beyond)
        for band in self._bands.pop(frame.tick):
            if derived.get((band.array, band.offset)) != band.data:
                raise DifferenceError(
                    f"tick {frame.tick}: /band {band.who}, {band.array:.40} from"
                    f" {band.offset}: recorded what was not learned"
                )

    def bands(self) -> Iterator[wire.Band]:
        """Yield the bands of workers that share the learning, for a key-frame now."""
        return chain.from_iterable(worker.bands() for worker in self.workers)

    @property
    def _is_read_beyond(self) -> bool:
        """Whether there is the state of a later tick."""
        ahead = (one.message for one in self._outputs)
        return any(isinstance(m, wire.State) and m.tick > self.core.tick for m in ahead)

    def _differ(self, recorded: Recorded, derived: wire.Message | None) -> NoReturn:
        was = recorded.payload.decode()[:_SHOWN]
        would = "nothing" if derived is None else wire.encode(derived).decode()[:_SHOWN]
        raise DifferenceError(
            f"{self._where(recorded)}: recorded {was}, derived {would}"
        )

    def _where(self, recorded: Recorded) -> str:
        return (
            f"tick {self._under_way}: /{wire.topic(recorded.message.key)}"
            f" {recorded.message.sender} {recorded.sequence}"
        )

    # Giving the core what it was given -----------------------------------------------

    def _feed(self, recorded: Recorded) -> list[wire.Message]:
        """Give the core what made it say `recorded`; return what it says now."""
        late = self._late(recorded)
        if late is not None:
            said = self.core.overdue(late)
            # What workers that begin are passed once more was recorded, or not.
            return [m for m in said if not isinstance(m, wire.Band)]
        return self._feed_all(self._awaited(recorded.message))

    def _late(self, recorded: Recorded) -> int | None:
        """Return what was late if `recorded` was sent for that, as in `in_flight`."""
        in_flight = self.core.in_flight
        match recorded.message:
            case wire.Recall(repeats=repeats) if repeats and -repeats in in_flight:
                return -repeats
            case wire.Learn() if 0 in in_flight:
                return 0
            case wire.Wiring() | wire.WorkerWiring() | wire.WaveStart() if (
                min(in_flight, default=0) > 0
            ):
                start = self._next_start(recorded)
                late = 0 if start is None else start.repeats
                return late if late in in_flight else None
            case _:
                return None

    def _next_start(self, recorded: Recorded) -> wire.WaveStart | None:
        """Return the start of the wave that a wiring was sent for."""

        def start() -> wire.WaveStart | None:
            ahead = (one.message for one in (recorded, *self._outputs))
            return next((m for m in ahead if isinstance(m, wire.WaveStart)), None)

        self._read_until(lambda: start() is not None)
        return start()

    def _awaited(self, following: wire.Message | None) -> _Key | None:
        """Return which recorded messages the core needs, to say what follows.

        It waits for one kind of them at a time; of several waves in flight, what it
        said next tells which one settled first.
        """
        recall, in_flight = self.core.questions.recall, self.core.in_flight
        if recall is not None:
            return "recalled", recall.tick, recall.round
        if 0 in in_flight:
            return "learned", self._under_way, 0
        match following:
            case wire.State(wave=wave) | wire.Reached(wave=wave) if wave in in_flight:
                return "reports", wave, 0
            case (
                wire.Learn()
                | wire.Anomaly()
                | wire.Wiring()
                | wire.WorkerWiring()
                | wire.WaveStart()
            ) if not in_flight:
                self._under_way = self.core.tick + 1
                return "observation", self._under_way, 0
            case _:
                return None

    def _feed_all(self, awaited: _Key | None) -> list[wire.Message]:
        """Give the core what it waits for, one by one, until it says something."""
        while awaited is not None and self._read_until(lambda: awaited in self._inputs):
            for message in self._inputs.pop(awaited):
                said = self._feed_one(message)
                if said or isinstance(message, wire.Observation):
                    return said
        return []

    def _feed_one(self, message: wire.Message) -> list[wire.Message]:
        """Give the core a message that was recorded, and check that it is right.

        What the core refuses it refused then, too: that counts for nothing.
        """
        if isinstance(message, wire.Observation):
            self._check_observation(message)
        recall = self.core.questions.recall
        said = self.core.receive(message)
        if any(isinstance(one, wire.Fault) for one in said):
            return []
        match message:
            case wire.CellReport() | wire.WorkerReport():
                literals = np.array(fired(message)[0], np.int64)
                self._reached[message.wave][literals] = True
            case wire.Learned():
                self._check_learned(message)
            case wire.Recalled() if recall is not None:
                self._check_recalled(recall, message)
            case _:
                pass
        return said

    def _let_answer(self) -> None:
        """Give the core the answers to its question, if it was not asked again.

        They may make the tick whole; a run that is taken up there says its decision
        only after that.
        """
        if self.core.questions.recall is None:
            return
        self._read_until(lambda: bool(self._outputs))
        following = self._outputs[0].message if self._outputs else None
        if not isinstance(following, wire.Recall) or not following.repeats:
            self._said.extend(self._feed_all(self._awaited(following)))

    # Checking what it was given -------------------------------------------------------

    def _check_observation(self, observation: wire.Observation) -> None:
        """Hold what was sensed of the last step against what was decided in it."""
        tick = observation.tick
        try:
            bits, known = unpack_readings(
                observation.bits, observation.known, self.options.body.count
            )
        except ShapeError as error:
            raise DifferenceError(f"tick {tick}: /observation: {error}") from error
        memory = self.core.memory
        if memory.body is not self._body:
            self._body = memory.body
            self._senses.fit(memory.body)
        own = slice(len(self.options.body.own))
        step = self.core.decision.action, self.core.snapshot.state, observation.begins
        sure = None if known is None else known[own]
        derived = selection(*self._senses.observe(bits[own], sure, *step))
        self._observed = selection(bits, known)
        differs = derived != self._observed
        if differs.any():
            wrong = self.options.sensors[int(differs.argmax()) >> 1]
            raise DifferenceError(
                f"tick {tick}: /observation: {wrong} does not follow from the decision and"
                f" the state of tick {tick - 1}"
            )

    def _learn(self, learn: wire.Learn) -> list[wire.Band]:
        """Let workers learn, as they were told to; return the bands they send."""
        said = [one for worker in self.workers for one in worker.learn(learn)]
        self._would = [one for one in self._would if one.tick == learn.tick]
        self._would += [one for one in said if isinstance(one, wire.Learned)]
        return [one for one in said if isinstance(one, wire.Band)]

    def _check_learned(self, learned: wire.Learned) -> None:
        """Hold what a worker learned against what it should have."""
        if learned not in self._would:
            raise DifferenceError(
                f"tick {learned.tick}: /learned {learned.sender}, part {learned.part}:"
                f" recorded {wire.encode(learned).decode()[:_SHOWN]}, which does not"
                " follow from what it was told"
            )

    def _check_recalled(self, recall: wire.Recall, answer: wire.Recalled) -> None:
        """Hold what a part recalled against what its sensors had read.

        That it lacks a history is taken at its word: it may have missed a reading.
        """
        if answer.lacks:
            return
        history = self.core.memory.history
        derived = self.core.questions.answer(answer.who, recall, history)
        if derived != [answer]:
            raise DifferenceError(
                f"tick {recall.tick}: /recalled {answer.who}, round {recall.round}:"
                f" recorded {wire.encode(answer).decode()[:_SHOWN]},"
                f" derived {b''.join(map(wire.encode, derived)).decode()[:_SHOWN]}"
            )

    # Reading --------------------------------------------------------------------------

    def _read_until(self, found: Callable[[], bool]) -> bool:
        """Read on until `found` holds; return whether it does."""
        while not found():
            recorded = next(self._messages, None)
            if recorded is None:
                self._exhausted = True
                return False
            if self._is_before(recorded):
                continue
            message = recorded.message
            key = _key_of(message)
            if isinstance(message, wire.Band):
                self._bands.setdefault(message.tick, []).append(message)
            elif key is None:
                self._outputs.append(recorded)
            else:
                self._inputs.setdefault(key, []).append(message)
        return True

    def _is_before(self, recorded: Recorded) -> bool:
        """Tell whether a message was sent before the key-frame to begin with."""
        if self._start is None:
            return False
        match recorded.message:
            case (
                wire.Observation(tick=tick)
                | wire.Recalled(tick=tick)
                | wire.Band(tick=tick)
                | wire.Learn(tick=tick)
                | wire.Learned(tick=tick)
            ):
                return tick <= self.first
            case wire.CellReport(wave=wave) | wire.WorkerReport(wave=wave):
                return wave <= self._start.frame.waves
            case _:
                return recorded.sequence <= self._start.sequence


def _key_of(message: wire.Message) -> _Key | None:
    """Return what a message that the core was given answers; None for another one."""
    match message:
        case wire.Observation(tick=tick):
            return "observation", tick, 0
        case wire.CellReport(wave=wave) | wire.WorkerReport(wave=wave):
            return "reports", wave, 0
        case wire.Recalled(tick=tick, round=number):
            return "recalled", tick, number
        case wire.Learned(tick=tick):
            return "learned", tick, 0
        case _:
            return None


def _workers(
    options: RunOptions, frame: wire.KeyFrame | None, bands: Iterable[wire.Band]
) -> list[WorkerLearning]:
    """Return those that share the learning of a run, as they are at a key-frame."""
    found = []
    for number in range(len(options.learning_shares)):
        worker = options.new_worker_learning(number)
        if worker is not None and frame is not None:
            for band in bands:
                worker.receive_band(band)
            worker.begin(frame.snapshot)
        if worker is not None:
            found.append(worker)
    return found
