"""The coordinator: learns, wires the cells, starts waves, decides.

`Coordinator` is a pure core: every message it sends is a function of the messages it
was given, in order. That is what makes a recording checkable: fed with the recorded
observations and reports, the same core must say the same again, byte for byte.

The state is what the cells reported. The snapshot only learns weights here; it is told
the state (`Snapshot.adopt`) and never asked for one.

Right after a key-frame all there is in here is a function of what that says, and of the
run's options: nothing is under way, what a policy keeps is in the key-frame, and what
was known of the cells' wiring is forgotten, so that the next goes to all of them, and
whole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.agent.growth.sensor_changes import changes_in
from neurosnap.errors import MessageError, ShapeError
from neurosnap.poc.learning.bands import count_of, head_of
from neurosnap.protocol.anomaly_judge import AnomalyJudge
from neurosnap.protocol.key_frames import order_of, snapshot_of, with_snapshot
from neurosnap.protocol.learn_control import LearnControl, to_weigh
from neurosnap.protocol.message_checks import check_readings
from neurosnap.protocol.observations import readings
from neurosnap.protocol.recall_control import RecallControl
from neurosnap.protocol.totals import Totals
from neurosnap.protocol.wave_control import WaveControl
from neurosnap.sensorium import complement, pack, selection

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from neurosnap.agent.growth.changed import Changed
    from neurosnap.agent.memory import AgentMemory
    from neurosnap.agent.policy import Closures, Deliberation, Policy
    from neurosnap.poc.learning.kinds import Snapshot
    from neurosnap.poc.learning.search import Answer, Search
    from neurosnap.poc.order.graph import PocGraph
    from neurosnap.protocol.run_options import RunOptions, WiringKind
    from neurosnap.protocol.wave import Wave

_WHO = "coordinator"


class Coordinator:
    """The sans-I/O core.

    Args:
        snapshot: Learns; new, or as it was after the last tick of a resumed run.
        policy: Decides.
        memory: What the agent knows besides the snapshot, in a run whose sensors grow
            or whose policy imagines; None: nothing.
        wiring: Which edges carry the pulses.
        ticks: Observations after which the run is over.
        keyframe_every: Ticks between two whole snapshots on the wire.
        band: Numbers of an array that travel in one message, at most; where pairs are
            not more than that, they are in the key-frame. 0: they always are.
        repeats: How often a wave that does not settle is sent again.
        workers: How many workers share the cells; 0: every cell is a part of its own.
        hold: How long to go on judging observations by the order that the first of them
            broke, in ticks; None: not to judge them.
        support: The occasions an anomaly must rest on to be told; 0: all are, and none
            are counted.
        shares: The sensors whose pairs with those before them each worker learns;
            empty: the snapshot does all of that.
    """

    def __init__(
        self,
        snapshot: Snapshot,
        policy: Policy,
        memory: AgentMemory | None = None,
        *,
        wiring: WiringKind,
        ticks: int,
        keyframe_every: int,
        band: int = 0,
        repeats: int = 2,
        workers: int = 0,
        hold: int | None = None,
        support: int = 0,
        shares: Sequence[range] = (),
    ) -> None:
        self.totals = Totals()
        self.finished = False
        if shares and len(snapshot.share):
            snapshot = snapshot.without_pairs()
        self._snapshot = snapshot
        # What workers that share the learning go on from, until they have learned.
        self._begins = b""
        self._passed_on: list[wire.Band] = []
        self._policy = policy
        self._memory = memory
        self._wiring: WiringKind = wiring
        self._ticks = ticks
        self._keyframe_every = keyframe_every
        self._band = band
        self._control = WaveControl(len(snapshot.sensorium), repeats, workers)
        self._recall = RecallControl(len(snapshot.sensorium), repeats, workers)
        self._graph: PocGraph = self._snapshot.poc_graph()
        self._learning = LearnControl(shares, repeats)
        self._anomaly: wire.Anomaly | None = None  # to be told once that is
        self._tick = 0
        self._signal: tuple[int, ...] = ()  # what was observed at the tick under way
        self._changed = False  # whether the graph did since the last wiring
        self._known = b""  # which readings of the last observation were known
        self._grows = memory is not None and memory.body.room > 0
        self._judge: AnomalyJudge | None = None
        if hold is not None:
            self._judge = AnomalyJudge(
                snapshot.sensorium,
                hold,
                support,
                remembers=not self._grows,
            )
        self._asked: dict[int, int] = {}  # planning wave -> which question it is
        self._answers: list[NDArray[np.bool_]] = []
        self._deliberation: Deliberation  # of the tick under way
        self._search: Search[None]  # for what to grow, in the tick under way
        self._stopping = False
        self._ending = False  # waits for the last words of workers that learn
        self._next_decision = wire.Decision(0, -1, "the run begins")

    @classmethod
    def of(
        cls,
        options: RunOptions,
        frame: wire.KeyFrame | None = None,
        bands: Iterable[wire.Band] = (),
    ) -> Self:
        """Return the core of a run.

        Args:
            options: The run's.
            frame: One of its key-frames, for the core that has just said it; None: the
                core has seen nothing yet.
            bands: What belongs to the key-frame.

        Raises:
            InvalidValueError: What the key-frame holds cannot be of such a run.
        """
        memory, shares = options.new_memory(), options.learning_shares
        if frame is not None:
            snapshot = (
                order_of(frame, bands, shares) if shares else snapshot_of(frame, bands)
            )
        else:
            snapshot = options.new_snapshot(range(0) if shares else None)
        core = cls(
            snapshot,
            options.policy_with(memory),
            None if memory.is_empty else memory,
            wiring=options.wiring,
            ticks=options.ticks,
            keyframe_every=options.keyframe_every,
            band=options.largest_band if shares else options.band,
            workers=options.sharing,
            hold=options.hold if options.watch else None,
            support=options.support,
            shares=shares,
        )
        if frame is not None:
            core._start_at(frame)
        return core

    def _start_at(self, frame: wire.KeyFrame) -> None:
        self._control.start_at(frame.waves, frame.epochs)
        self._next_decision = wire.Decision(frame.tick, frame.action, frame.why)
        if self._memory is not None:
            self._memory.restore(frame.agent)
            self._policy.grow(self._memory.body)
            self._next_decision = self._memory.decision
        self._tick, self._known = frame.tick, frame.known
        self.totals = Totals(
            ticks=frame.tick,
            waves=frame.waves,
            pulses=frame.pulses,
            depth=frame.depth,
            height=self._graph.height(),
            edges=(self._graph.wire_count() + 1) // 2,
            incoherent=frame.incoherent,
            anomalies=frame.anomalies,
            told=frame.told,
        )
        if self._judge is not None:
            self._judge.restore(frame.history)
        self._count_grown()

    @property
    def tick(self) -> int:
        """The last whole tick: its decision is taken."""
        return self._tick

    @property
    def graph(self) -> PocGraph:
        """The learned order the cells are wired by."""
        return self._graph

    @property
    def snapshot(self) -> Snapshot:
        """What has been learned; without the pairs, where workers share them."""
        return self._snapshot

    def pass_on(self, bands: Iterable[wire.Band]) -> None:
        """Let `begin` tell workers that share the learning what they go on from.

        Args:
            bands: Of the tick that the run is at.
        """
        self._passed_on = [msgspec.structs.replace(band, who=_WHO) for band in bands]

    @property
    def memory(self) -> AgentMemory | None:
        """What the agent knows besides the snapshot; None: nothing."""
        return self._memory

    def changes(self, decision: wire.Decision) -> list[Changed]:
        """Return which sensors the last decision grew and retired."""
        memory = self._memory
        return [] if memory is None else list(changes_in(decision, memory.body))

    @property
    def decision(self) -> wire.Decision:
        """The last decision taken."""
        return self._next_decision

    @property
    def in_flight(self) -> tuple[int, ...]:
        """What has not come to its end.

        Waves by number; a question as its -round; and 0, if the workers learn.
        """
        recall = self._recall.recall
        asked = () if recall is None else (-recall.round,)
        learning = () if self._learning.under_way is None else (0,)
        return *self._control.in_flight, *asked, *learning

    @property
    def questions(self) -> RecallControl:
        """What the cells' histories are asked."""
        return self._recall

    def begin(self) -> list[wire.Message]:
        """Open the run, or go on with one from a key-frame: ask for an observation."""
        first = self._keyframe() if self._tick else self._control.rewire_whole()
        self._learning.forget()
        for frame in first:
            if isinstance(frame, wire.KeyFrame):
                self.begin_with(frame)
        return [*first, *self._passed_on, self._next_decision]

    def begin_with(self, frame: wire.KeyFrame) -> None:
        """Let workers that share the learning go on from a key-frame that was said."""
        self._begins = frame.snapshot if self._learning.shares else b""

    def go_on(self, ticks: int) -> None:
        """Let a run that ended go on to `ticks`."""
        self._ticks = ticks
        self.finished = self._stopping = self._ending = False

    def receive(self, message: wire.Message) -> list[wire.Message]:
        """Take in one message and return what is to be sent for it, in order.

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
                return self._hear(message)
            case wire.Learned():
                return self._take_learned(message)
            case wire.Fault():  # anybody's: its own come back to it, too
                self.totals.faults += 1
                return []
            case _:
                return [
                    _fault(f"{wire.topic(message.key)}: is not for the coordinator")
                ]

    def overdue(self, number: int) -> list[wire.Message]:
        """Send again what has not come to its end within its deadline.

        Args:
            number: As in `in_flight`.

        Raises:
            WaveLostError: A wave was sent often enough.
            AnswerLostError: A question was.
            LearningLostError: What to learn was.
        """
        if not number:
            return [*self._passed_on, *self._learning.repeat()]
        if number < 0:
            return self._recall.repeat()
        messages = self._control.repeat(number, self._signal)
        if number in self._asked:
            self._asked[self._control.waves] = self._asked.pop(number)
        return messages

    def stop(self) -> list[wire.Message]:
        """End the run after the tick under way, if there is one."""
        self._stopping = True
        if self.finished or self._ending or self._signal:
            return []
        return self._finish()

    def _observe(self, observation: wire.Observation) -> list[wire.Message]:
        if self.finished or self._stopping or self._ending:
            return []
        expected = self._tick + 1
        if observation.tick != expected or self._signal:
            what = f"must be tick {expected}, once, got tick {observation.tick}"
            return [_fault(f"observe: {what}")]
        try:
            check_readings(observation)
            bits, known = readings(observation, len(self._snapshot.sensorium))
        except MessageError as error:
            return [_fault(str(error))]
        except ShapeError as error:
            return [_fault(f"observe: {error}")]
        if observation.paused and self._grows:
            rule = "must not be paused in a run that grows sensors"
            return [_fault(f"observe: {rule}, got tick {observation.tick}")]
        said: wire.Anomaly | None = None
        if self._judge is not None:
            history = None if self._memory is None else self._memory.history
            weighs = not self._learning.shares
            step = observation, self._snapshot, weighs, bits, known, history
            said = self._judge.judge(*step, self.totals)
        self._known = observation.known
        if self._memory is not None:
            # Nobody saw what the action would have led to.
            action = -1 if observation.cut else self._next_decision.action
            before = action, observation.begins, self._snapshot.state
            believed = self._snapshot.poc_graph()
            self._search = self._memory.observe(
                *before, believed, bits, known, self._snapshot
            )
        if observation.paused:
            self._snapshot.skip()
        else:
            self._changed |= self._snapshot.learn(bits, known)
        self._signal = tuple(np.flatnonzero(selection(bits, known)).tolist())
        if self._learning.shares:
            self._anomaly = said
            return self._learning.ask(_to_learn(observation, said, self._begins))
        return self._follow(said)

    def _take_learned(self, message: wire.Learned) -> list[wire.Message]:
        """Take in what a worker learned; go on once all have."""
        learn = self._learning.under_way
        try:
            pairs = self._learning.receive(message)
        except MessageError as error:
            return [_fault(str(error))]
        if pairs is None or learn is None:
            return []
        if not learn.frame:  # else they say once more what is known
            self._changed |= self._snapshot.relate(*pairs)
        if self._learning.under_way is not None:
            return []
        self._begins, self._passed_on = b"", []
        if learn.frame:
            self.finished = self._ending
            return [] if self.finished else [self._next_decision]
        said, self._anomaly = self._anomaly, None
        return self._follow(None if said is None else self._learning.weighed(said))

    def _follow(self, said: wire.Anomaly | None) -> list[wire.Message]:
        """Let the wiring follow what was learned, and the state wave begin."""
        messages: list[wire.Message] = [] if said is None else [said]
        changed, self._changed = self._changed, False
        if changed:
            self._graph = self._snapshot.poc_graph()
        if changed or self._control.is_forgotten:
            messages += self._control.follow(self._graph, self._wiring)
        tick, seeds = self._tick + 1, len(self._signal)
        return [*messages, *self._control.start("state", tick, seeds=seeds)]

    def _settle(
        self, report: wire.CellReport | wire.WorkerReport
    ) -> list[wire.Message]:
        try:
            wave = self._control.report(report)
        except MessageError as error:
            return [_fault(str(error))]
        if wave is None:
            return []
        reached = np.zeros(2 * len(self._snapshot.sensorium), dtype=np.bool_)
        reached[list(wave.hops)] = True
        self.totals.pulses += wave.pulses
        self.totals.depth = max(self.totals.depth, wave.depth)
        if wave.number in self._asked:
            return self._answer(wave, reached)
        return self._conclude(wave, reached)

    def _conclude(self, wave: Wave, reached: NDArray[np.bool_]) -> list[wire.Message]:
        """Turn a settled state wave into the tick's state; send the planning waves."""
        state = reached & ~complement(reached)
        self._snapshot.adopt(state)
        report = self._state(wave, reached, state)
        self._count(report)
        return [report, *self._remind(wave.tick), *self._look_back(wave.tick)]

    def _remind(self, tick: int) -> list[wire.Message]:
        """Tell a cell that has just been born what it would have read before.

        It has taken part in a wave by now: whoever hosts it has this tick's readings.
        """
        born = self._next_decision.born
        if self._memory is None or born < 0:
            return []
        return self._recall.remind(tick, born, self._memory.history)

    def _look_back(self, tick: int, answer: Answer | None = None) -> list[wire.Message]:
        """Let the search for what to grow go on; at its end, let the policy begin."""
        memory, state = self._memory, self._snapshot.state
        if memory is not None:
            try:
                # None starts it.
                question = self._search.send(answer)  # type: ignore[arg-type]
                return self._recall.ask(tick, question)
            except StopIteration:
                pass
            memory.settle(state)
        self._deliberation = self._policy.decide(tick, state)
        return self._deliberate(tick)

    def _hear(self, message: wire.Recalled) -> list[wire.Message]:
        """Take in what a part answers from its histories."""
        if self._memory is None:
            return [_fault(f"recalled: must be asked, got {message.who:.40}")]
        try:
            heard = self._recall.receive(message, self._memory.history)
        except MessageError as error:
            return [_fault(str(error))]
        if isinstance(heard, list):
            return heard
        return self._look_back(message.tick, heard)

    def _deliberate(
        self, tick: int, answers: Closures | None = None
    ) -> list[wire.Message]:
        """Let the policy go on; send what it asks as waves, or what it decides."""
        try:
            # None starts it.
            questions = self._deliberation.send(answers)  # type: ignore[arg-type]
        except StopIteration as end:
            return self._decide(tick, *end.value)
        self._answers = [np.empty(0, np.bool_)] * len(questions)
        starts: list[wire.Message] = []
        for index, signal in enumerate(questions):
            starts += self._control.start("signal", tick, signal)
            self._asked[self._control.waves] = index
        return starts

    def _answer(self, wave: Wave, reached: NDArray[np.bool_]) -> list[wire.Message]:
        """Take in a settled planning wave; go on if it was the last that was asked."""
        self._answers[self._asked.pop(wave.number)] = reached
        result = wire.Reached(
            tick=wave.tick,
            wave=wave.number,
            signal=wave.signal,
            literals=pack(reached),
            depth=wave.depth,
            longest=self._longest(wave.signal),
            height=self._graph.height(),
            pulses=wave.pulses,
        )
        if self._asked:
            return [result]
        return [result, *self._deliberate(wave.tick, self._answers)]

    def _decide(self, tick: int, action: int, why: str) -> list[wire.Message]:
        """Close the tick: a key-frame if one is due, and the decision."""
        self._next_decision = self._grown(tick, action, why)
        self._tick = tick
        self._signal = ()
        self.totals.ticks += 1
        self.totals.waves = self._control.waves
        if self._stopping or tick == self._ticks:
            return self._finish()
        if tick % self._keyframe_every:
            return [self._next_decision]
        if self._learning.shares:
            return [*self._keyframe(), *self._learning.ask_bands(tick, b"")]
        return [*self._keyframe(), self._next_decision]

    def _grown(self, tick: int, action: int, why: str) -> wire.Decision:
        """Return the decision, once all is as it says: a sensor grown, or retired.

        Nothing is in flight, and the next state wave is behind the wirings it takes.
        """
        memory = self._memory
        if memory is None:
            return wire.Decision(tick, action, why)
        decision = wire.Decision(tick, action, why, **memory.changes)
        if memory.follow(decision, self._snapshot):
            self._policy.grow(memory.body)
            self._changed = True
            self._count_grown()
            if self._judge is not None:
                self._judge.rename(self._snapshot.sensorium)
        return decision

    def _longest(self, signal: tuple[int, ...]) -> int:
        return int(self._graph.heights()[list(signal)].max(initial=0))

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
            height=self._graph.height(),
            edges=(self._graph.wire_count() + 1) // 2,
            pulses=wave.pulses,
        )

    def _count(self, state: wire.State) -> None:
        self.totals.height = state.height
        self.totals.edges = state.edges
        self.totals.incoherent += state.incoherent

    def _count_grown(self) -> None:
        if self._memory is not None:
            body = self._memory.body
            self.totals.grown, self.totals.retired = len(body.grown), len(body.retired)

    def _keyframe(self) -> list[wire.Message]:
        """Return what somebody else may go on from: nothing older matters then."""
        judge, sensorium = self._judge, self._snapshot.sensorium
        history = b"" if judge is None else judge.to_bytes(sensorium)
        self._control.forget()
        frame = wire.KeyFrame(
            tick=self._tick,
            snapshot=b"",
            waves=self._control.waves,
            epochs=self._control.epochs,
            known=self._known,
            action=self._next_decision.action,
            why=self._next_decision.why,
            pulses=self.totals.pulses,
            depth=self.totals.depth,
            incoherent=self.totals.incoherent,
            anomalies=self.totals.anomalies,
            agent=b"" if self._memory is None else self._memory.to_bytes(),
            told=self.totals.told,
            history=history,
        )
        shares = self._learning.shares
        if not shares:
            return [*with_snapshot(frame, self._snapshot, self._band, _WHO)]
        head, bands = (
            head_of(self._snapshot),
            count_of(self._snapshot, self._band, shares),
        )
        return [msgspec.structs.replace(frame, snapshot=head, bands=bands)]

    def _finish(self) -> list[wire.Message]:
        """End: at once, or when the workers that learn have sent their bands."""
        if self._tick and self._learning.shares:
            self._ending = True
            ask = self._learning.ask_bands(self._tick, self._begins)
            return [*self._keyframe(), *ask]
        self.finished = True
        return self._keyframe() if self._tick else []


def _to_learn(
    observation: wire.Observation, said: wire.Anomaly | None, begins: bytes
) -> wire.Learn:
    """Return what tells the workers to learn an observation."""
    sources, targets = ((), ()) if said is None else to_weigh(said)
    return wire.Learn(
        tick=observation.tick,
        bits=observation.bits,
        known=observation.known,
        paused=observation.paused,
        begins=begins,
        sources=sources,
        targets=targets,
    )


def _fault(what: str) -> wire.Fault:
    return wire.Fault(_WHO, what)
