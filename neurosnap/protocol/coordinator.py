"""The coordinator: learns, wires the cells, starts waves, decides.

`Coordinator` is a pure core: every message it sends is a function of the messages it
was given, in order. That is what makes a recording checkable: fed with the recorded
observations and reports, the same core must say the same again, byte for byte.

What a tick consists of is said in `neurosnap.agent.tick`. The coordinator drives it: it
turns what the tick asks for into messages, and lets it proceed once their answers are
whole.

It has no lock. `neurosnap.runtime.parts.coordinator_loop` calls it from two threads,
deliveries from the fabric's and deadlines from the loop's, and holds one lock round
each call and the sending of what it returns.

The state is what the cells reported. The snapshot only learns weights here; it is told
the state (`Snapshot.adopt`) and never asked for one.

Right after a key-frame the whole core is a function of what that says, and of the run's
options: nothing is under way, what a policy keeps is in the key-frame, and what
was known of the cells' wiring is forgotten, so that the next goes to all of them, and
whole. So are the places from which no way was found: they are searched once more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.agent.growth_in_decisions import changes_in
from neurosnap.agent.tick import Mind, Sensed, Step, Steps, tick
from neurosnap.errors import MessageError, ShapeError
from neurosnap.poc.learning.history_questions import Question
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.protocol.anomaly_report import with_support
from neurosnap.protocol.cell_and_worker_base import check_readings
from neurosnap.protocol.key_frames import (
    HEAD,
    joined_bytes,
    order_of,
    snapshot_of,
    with_snapshot,
)
from neurosnap.protocol.learn_control import LearnControl
from neurosnap.protocol.recall_control import RecallControl
from neurosnap.protocol.wiring_and_waves import WaveControl
from neurosnap.sensorium import complement, pack, selection, unpack_readings
from neurosnap.sources.meaning import compared, numbers_in

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from neurosnap.agent.growth_in_decisions import Changed
    from neurosnap.agent.memory import AgentMemory
    from neurosnap.agent.policy import Policy, Signal
    from neurosnap.poc.learning.snapshot import Snapshot
    from neurosnap.poc.order.graph import PocGraph
    from neurosnap.protocol.run_options import RunOptions
    from neurosnap.protocol.wave_settling import Wave

MOST_WAVES = 1 << 15
"""Waves from one key-frame to the next, about: some searches take hundreds a tick."""
_WHO = "coordinator"


class Totals(msgspec.Struct, kw_only=True):
    """The coordinator's counts for a whole run."""

    ticks: int = 0
    """Observations learned from, each with its state."""
    waves: int = 0
    """Waves started."""
    pulses: int = 0
    """Pulses sent in the waves that settled."""
    depth: int = 0
    """The deepest wave's hops."""
    height: int = 0
    """The height of the order at the end."""
    edges: int = 0
    """Edges of its Hasse wiring, an edge and its contrapositive counted as one."""
    incoherent: int = 0
    """Observations that contradicted what was learned."""
    anomalies: int = 0
    """Observations that contradicted what was believed before they were learned."""
    told: int = 0
    """Those of them that have the support that the run asks for."""
    faults: int = 0
    """Messages dropped as bad or unexpected."""
    grown: int = 0
    """Sensors that were grown."""
    retired: int = 0
    """Those of them that are not read any more."""


class Coordinator:
    """The pure core of the coordinator.

    Args:
        options: The run's.
        snapshot: Learns; None for a new one, as the options say.
        policy: Decides; None for a new one.
        repeats: How often a wave that does not settle is sent again, and a question
            that is not answered is asked again.

    Attributes:
        totals: What the run came to so far.
        finished: Whether nothing more is to come.
        questions: What the cells' histories are asked.
        graph: The learned order that the cells are wired by.
    """

    def __init__(
        self,
        options: RunOptions,
        snapshot: Snapshot | None = None,
        policy: Policy | None = None,
        *,
        repeats: int = 2,
    ) -> None:
        self.totals = Totals()
        self.finished = False
        shares, workers = options.learning_shares, options.sharing
        if snapshot is None:
            snapshot = options.new_snapshot(range(0) if shares else None)
        elif shares and len(snapshot.share):
            snapshot = snapshot.without_pairs()
        snapshot.assume(options.known_order)
        memory = options.new_memory()
        policy = options.new_policy(memory) if policy is None else policy
        self._mind = Mind(snapshot, policy, memory)
        self._options = options
        self._ticks = options.ticks
        self._control = WaveControl(len(snapshot.sensorium), repeats, workers)
        self.questions = RecallControl(len(snapshot.sensorium), repeats, workers)
        self._learning = LearnControl(shares, repeats)
        self.graph: PocGraph = snapshot.poc_graph()
        self._changed = False  # whether the graph did since the last wiring
        self._known = b""  # which readings of the last observation were known
        self._framed = 0  # the waves at the last key-frame
        self._detector: AnomalyDetector | None = None
        if options.watch:
            self._detector = AnomalyDetector(
                len(snapshot.sensorium),
                options.hold,
                options.support,
            )
        # Of the tick under way.
        self._steps: Steps | None = None
        self._observation: wire.Observation
        self._sensed: Sensed  # the same, decoded
        self._signal = np.zeros(0, np.int64)  # what was observed
        self._compared = compared(map(options.conditions.get, options.body.own))
        self._anomaly: wire.Anomaly | None = None  # to be told once that is learned
        self._asked: dict[int, int] = {}  # planning wave -> which question it is
        self._answers: list[NDArray[np.bool_]] = []
        # At the end of the run.
        self._stopping = False
        self._ending = False  # waits for the last words of workers that learn

    @classmethod
    def from_key_frame(
        cls,
        options: RunOptions,
        frame: wire.KeyFrame,
        bands: Iterable[wire.Band] = (),
    ) -> Self:
        """Return the core of a run that has just published a key-frame and its bands.

        The frame is `whole`.

        Raises:
            InvalidValueError: What the key-frame holds cannot be of such a run.
        """
        shares, bands = options.learning_shares, [*bands]
        core = cls(
            options,
            order_of(frame, bands, shares) if shares else snapshot_of(frame, bands),
        )
        core._start_at(frame)
        return core

    def _start_at(self, frame: wire.KeyFrame) -> None:
        self._control.start_at(frame.waves, frame.epochs)
        memory = self._mind.memory
        memory.decision = wire.Decision(frame.tick, frame.action, frame.why)
        memory.restore(frame.agent)
        if not memory.is_empty:
            self._mind.policy.grow(memory.body)
        self._known = frame.known
        self._framed = frame.waves
        self.totals = Totals(
            ticks=frame.tick,
            waves=frame.waves,
            pulses=frame.pulses,
            depth=frame.depth,
            height=self.graph.height(),
            edges=(len(self.graph.wire_list()) + 1) // 2,
            incoherent=frame.incoherent,
            anomalies=frame.anomalies,
            told=frame.told,
        )
        if self._detector is not None:
            self._detector.restore(frame.history)
        self._count_grown()

    # What its process asks it ---------------------------------------------------------

    @property
    def tick(self) -> int:
        """The last whole tick: its decision is taken."""
        return self._mind.decision.tick

    @property
    def snapshot(self) -> Snapshot:
        """What has been learned; without the pairs, where workers share them."""
        return self._mind.snapshot

    @property
    def memory(self) -> AgentMemory:
        """What the agent knows besides the snapshot."""
        return self._mind.memory

    @property
    def decision(self) -> wire.Decision:
        """The last decision taken."""
        return self._mind.decision

    def changes(self, decision: wire.Decision) -> list[Changed]:
        """Return which sensors the last decision grew and retired."""
        return list(changes_in(decision, self._mind.memory.body))

    @property
    def in_flight(self) -> tuple[int, ...]:
        """What has not come to its end.

        Waves by number; a question as its -round; and 0, if the workers learn.
        """
        recall = self.questions.recall
        asked = () if recall is None else (-recall.round,)
        learning = () if self._learning.under_way is None else (0,)
        return *self._control.in_flight, *asked, *learning

    # How a run begins and ends --------------------------------------------------------

    def begin(self) -> list[wire.Message]:
        """Open the run, or resume it from a key-frame: ask for an observation."""
        first = self._keyframe() if self.tick else []
        self._learning.forget()
        said = [*first, *self._learning.passed_on, self.decision]
        if self._learning.shares:
            bands = [one for one in first if isinstance(one, wire.Band)]
            self.begin_with(len(joined_bytes(HEAD, bands)))
            self._learning.passed_on += (b for b in bands if b.array == HEAD)
        return said

    def begin_with(self, size: int) -> None:
        """Set the size of the snapshot that workers that share the learning begin with.

        It is that of the key-frame which the run goes on from.
        """
        self._learning.begins = size

    def resume(self, ticks: int, bands: Iterable[wire.Band] = ()) -> None:
        """Continue a run that has ended, up to `ticks`.

        Workers that share the learning are passed the bands of the tick it is at.
        """
        self._ticks = ticks
        self.finished = self._stopping = self._ending = False
        replace = msgspec.structs.replace
        self._learning.passed_on = [replace(band, who=_WHO) for band in bands]

    def stop(self) -> list[wire.Message]:
        """End the run after the tick under way, if there is one."""
        self._stopping = True
        if self.finished or self._ending or self._steps is not None:
            return []
        return self._finish()

    def _finish(self) -> list[wire.Message]:
        """End: at once, or when the workers that learn have sent their bands."""
        if self.tick and self._learning.shares:
            self._ending = True
            return [*self._keyframe(), *self._learning.ask_bands(self.tick)]
        self.finished = True
        return self._keyframe() if self.tick else []

    # Messages in, messages out --------------------------------------------------------

    def receive(self, message: wire.Message) -> list[wire.Message]:
        """Receive a message and return what is to be sent for it, in order.

        Reads: observations, reports, faults. Publishes: wirings and a wave start for an
        observation; for the report that settles a wave its result, then the planning
        waves, and once all have settled key-frames and a decision.
        """
        match message:
            case wire.Observation():
                return self._observe(message)
            case wire.CellReport() | wire.WorkerReport():
                return self._settle(message)
            case wire.Recalled():
                return self._receive_recalled(message)
            case wire.Learned():
                return self._receive_learned(message)
            case wire.Fault():  # of any part: its own come back to it, too
                self.totals.faults += 1
                return []
            case _:
                return [
                    _fault(f"{wire.topic(message.key)}: is not for the coordinator")
                ]

    def overdue(self, number: int) -> list[wire.Message]:
        """Send again what is past its deadline; `number` is as in `in_flight`.

        Raises:
            AnswerLostError: It was sent often enough.
        """
        if not number:
            return self._learning.repeat()
        if number < 0:
            return self.questions.repeat()
        messages = self._control.repeat(number, tuple(self._signal.tolist()))
        if number in self._asked:
            self._asked[self._control.waves] = self._asked.pop(number)
        return messages

    def _observe(self, observation: wire.Observation) -> list[wire.Message]:
        """Begin a tick."""
        if self.finished or self._stopping or self._ending:
            return []
        expected = self.tick + 1
        if observation.tick != expected or self._steps is not None:
            what = f"must be tick {expected}, once, got tick {observation.tick}"
            return [_fault(f"observation: {what}")]
        try:
            check_readings(observation)
            bits, known = unpack_readings(
                observation.bits, observation.known, len(self.snapshot.sensorium)
            )
        except MessageError as error:
            return [_fault(str(error))]
        except ShapeError as error:
            return [_fault(f"observation: {error}")]
        self._observation, self._known = observation, observation.known
        self._signal = np.flatnonzero(selection(bits, known))
        self._sensed = Sensed(bits, known, observation.begins, observation.cut)
        self._anomaly = self._judged()
        if self._anomaly is not None and observation.said:
            self._anomaly = self._with_numbers(self._anomaly, observation.said)
        self._steps = tick(self._mind, self._sensed)
        return self._proceed(self._steps)

    def _with_numbers(self, anomaly: wire.Anomaly, said: bytes) -> wire.Anomaly:
        """Return an anomaly with the numbers that its sensors compared."""
        links = (one for link in anomaly.links for one in (link.source, link.target))
        sensors = {*anomaly.culprits, *anomaly.candidates, *(one >> 1 for one in links)}
        read = numbers_in(said, self._compared)
        numbers = (
            wire.NumberRead(each, read[each]) for each in sorted(sensors & {*read})
        )
        return msgspec.structs.replace(anomaly, numbers=tuple(numbers))

    def _judged(self) -> wire.Anomaly | None:
        """Return the anomaly in the observation, if any; it is not learned yet."""
        if self._detector is None:
            return None
        # Workers that share the learning weigh what it breaks later.
        found = self._detector.watch(
            self._observation.tick,
            self.snapshot.poc_graph(),
            self._sensed.bits,
            self._sensed.known,
            None if self._learning.shares else self.snapshot,
        )
        if found is not None:
            self.totals.anomalies += 1
            self.totals.told += with_support(found, self._options.support) is not None
        return found

    def _proceed(self, steps: Steps, answer: object = None) -> list[wire.Message]:
        """Let the tick proceed; return what asks for what it needs done, or ends it."""
        try:
            request = steps.send(answer)
        except StopIteration as end:
            return self._close(end.value)
        match request:
            case Step.LEARN:
                return self._learn(steps)
            case Step.STATE_WAVE:
                return self._start_state_wave()
            case Question():
                return self.questions.ask(self.tick + 1, request)
            case _:
                return self._start_planning(request)

    def _answer(self, answer: object) -> list[wire.Message]:
        """Let the tick under way proceed with what it asked for."""
        return [] if self._steps is None else self._proceed(self._steps, answer)

    # What a tick needs done -----------------------------------------------------------

    def _learn(self, steps: Steps) -> list[wire.Message]:
        """Learn an observation, or let the workers that share the learning do so."""
        seen = self._sensed
        self._changed |= self.snapshot.learn(seen.bits, seen.known)
        if not self._learning.shares:
            return self._proceed(steps)
        return self._learning.ask_to_learn(self._observation, self._anomaly)

    def _receive_learned(self, message: wire.Learned) -> list[wire.Message]:
        """Learn what a worker reports; go on once all have."""
        learn = self._learning.under_way
        try:
            pairs = self._learning.receive(message)
        except MessageError as error:
            return [_fault(str(error))]
        if pairs is None or learn is None:
            return []
        if not learn.frame:  # else they say once more what is known
            self._changed |= self.snapshot.relate(*pairs)
        if self._learning.under_way is not None:
            return []
        if learn.frame:
            self.finished = self._ending
            return [] if self.finished else [self.decision]
        if self._anomaly is not None:
            self._anomaly = self._learning.weighed(self._anomaly)
        return self._answer(None)

    def _start_state_wave(self) -> list[wire.Message]:
        """Let the wiring follow what was learned, and the state wave begin."""
        messages: list[wire.Message] = []
        if self._anomaly is not None:
            messages.append(self._anomaly)
            self._anomaly = None
        changed, self._changed = self._changed, False
        if changed:
            self.graph = self.snapshot.poc_graph()
        if changed or self._control.wiring.is_forgotten:
            edges = self.graph.wire_list(self._options.wiring)
            messages += self._control.rewire(edges)
        now, seeds = self.tick + 1, len(self._signal)
        return [*messages, *self._control.start("state", now, seeds=seeds)]

    def _settle(
        self, report: wire.CellReport | wire.WorkerReport
    ) -> list[wire.Message]:
        """Count a report on a wave; go on if the wave has settled with it."""
        try:
            wave = self._control.report(report)
        except MessageError as error:
            return [_fault(str(error))]
        if wave is None:
            return []
        reached = wave.reached
        self.totals.pulses += wave.pulses
        self.totals.depth = max(self.totals.depth, wave.depth)
        if wave.number in self._asked:
            return self._settle_planning(wave, reached)
        state = reached & ~complement(reached)
        self.snapshot.adopt(state)
        said = self._state(wave, reached, state)
        self.totals.height, self.totals.edges = said.height, said.edges
        self.totals.incoherent += said.incoherent
        return [said, *self._answer(state)]

    def _receive_recalled(self, message: wire.Recalled) -> list[wire.Message]:
        """Receive what a part answers from its histories; go on once all have."""
        if not self._mind.memory.body.room:
            return [_fault(f"recalled: must be asked, got {message.who:.40}")]
        try:
            heard = self.questions.receive(message, self._mind.memory.history)
        except MessageError as error:
            return [_fault(str(error))]
        return heard if isinstance(heard, list) else self._answer(heard)

    def _start_planning(self, signals: list[Signal]) -> list[wire.Message]:
        """Start a planning wave for each signal, all in flight together."""
        self._answers = [np.empty(0, np.bool_)] * len(signals)
        starts: list[wire.Message] = []
        for index, signal in enumerate(signals):
            starts += self._control.start("signal", self.tick + 1, signal)
            self._asked[self._control.waves] = index
        return starts

    def _settle_planning(
        self, wave: Wave, reached: NDArray[np.bool_]
    ) -> list[wire.Message]:
        """Close a settled planning wave; go on if it was the last that was asked."""
        self._answers[self._asked.pop(wave.number)] = reached
        result = wire.Reached(
            tick=wave.tick,
            wave=wave.number,
            signal=wave.signal,
            literals=pack(reached),
            depth=wave.depth,
            longest=self._longest(np.array(wave.signal, np.int64)),
            height=self.graph.height(),
            pulses=wave.pulses,
        )
        return [result] if self._asked else [result, *self._answer(self._answers)]

    def _close(self, grown: bool) -> list[wire.Message]:
        """Close the tick: a key-frame if one is due, and the decision.

        Nothing is in flight, and the next state wave is behind the wirings it takes.
        `grown` says whether any sensor came or went.
        """
        if grown:
            self._changed = True
            self._learning.changes = (self.decision,)
            self._count_grown()
        self._steps, self._signal = None, self._signal[:0]
        self.totals.ticks += 1
        self.totals.waves = self._control.waves
        if self._stopping or self.tick == self._ticks:
            return self._finish()
        since = self._control.waves - self._framed
        if self.tick % self._options.keyframe_every and since < MOST_WAVES:
            return [self.decision]
        if self._learning.shares:
            return [*self._keyframe(), *self._learning.ask_bands(self.tick)]
        return [*self._keyframe(), self.decision]

    # What it says ---------------------------------------------------------------------

    def _longest(self, signal: NDArray[np.int64]) -> int:
        return int(self.graph.heights()[signal].max(initial=0))

    def _state(
        self, wave: Wave, reached: NDArray[np.bool_], state: NDArray[np.bool_]
    ) -> wire.State:
        return wire.State(
            tick=wave.tick,
            wave=wave.number,
            literals=pack(state),
            # What it implies is the state, unless that contradicts itself.
            incoherent=not np.array_equal(reached, state),
            depth=wave.depth,
            longest=self._longest(self._signal),
            height=self.graph.height(),
            edges=(len(self.graph.wire_list()) + 1) // 2,
            pulses=wave.pulses,
        )

    def _count_grown(self) -> None:
        body = self._mind.memory.body
        self.totals.grown, self.totals.retired = len(body.grown), len(body.retired)

    def _keyframe(self) -> list[wire.Message]:
        """Return what a run may go on from: nothing older matters then."""
        detector, options = self._detector, self._options
        history = b"" if detector is None else detector.to_bytes()
        self._control.wiring.is_forgotten = True
        self._framed = self._control.waves
        if self._mind.memory.experience is not None:
            self._mind.memory.experience.no_way.clear()
        frame = wire.KeyFrame(
            tick=self.tick,
            snapshot=b"",
            waves=self._control.waves,
            epochs=self._control.wiring.epochs,
            known=self._known,
            action=self.decision.action,
            why=self.decision.why,
            pulses=self.totals.pulses,
            depth=self.totals.depth,
            incoherent=self.totals.incoherent,
            anomalies=self.totals.anomalies,
            agent=self._mind.memory.to_bytes(),
            told=self.totals.told,
            history=history,
        )
        shares = self._learning.shares
        return [*with_snapshot(frame, self.snapshot, options.band, _WHO, shares)]


def _fault(what: str) -> wire.Fault:
    return wire.Fault(_WHO, what)
