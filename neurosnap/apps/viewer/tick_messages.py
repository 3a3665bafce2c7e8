"""Collects the recorded messages of some ticks, and the state of each sensor then.

Senders overtake each other in a recording: a tick's state may come before its
observation, or a report after the next tick has begun. So what belongs to a tick is
looked for from the chunk before the one it was observed in, and as far behind it as
something is missing.
"""

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.slow_cells import Answers
from neurosnap.apps.viewer.waves import Waves
from neurosnap.errors import RecordingError, ShapeError
from neurosnap.protocol.anomaly_report import (
    broken_rule,
    named_anomaly,
    with_support,
)
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.tick_times import Behind, TickTimes
from neurosnap.recording.read.chunk_messages import ChunkMessages
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.sensorium import selection, unpack, unpack_readings
from neurosnap.sources.open import is_file

NOT_RECORDED, UNKNOWN, OFF, ON, OFF_PREDICTED, ON_PREDICTED, CONTRADICTED = range(7)
"""Predicted: not read, but the state has it. Contradicted: the wave reached both
literals, so that the state has neither. Unknown: it reached none."""

_BEYOND = 4
"""Chunks behind the last tick in which something late is looked for. The recorder
closes a chunk five times a second, and nothing is on the way for longer than that."""


class Ticks:
    """The messages of the ticks `first` to `last`.

    Args:
        tick_index: The recording.
        options: The run's.
        first: From 1 up.
        last: Not before `first`.
        with_waves: Whether reports on waves are read, too, which are most of it.
        answers: Is given all that was heard of their waves.
    """

    def __init__(
        self,
        tick_index: TickIndex,
        options: RunOptions,
        first: int,
        last: int,
        *,
        with_waves: bool = True,
        answers: Answers | None = None,
    ) -> None:
        self.options = options
        self.observations: dict[int, wire.Observation] = {}
        self.sent: dict[int, int] = {}
        """When each of these was sent, ns since 1970."""
        self.states: dict[int, wire.State] = {}
        self.decisions: dict[int, wire.Decision] = {}
        self.anomalies: dict[int, wire.Anomaly] = {}
        self.reached: dict[int, wire.Reached] = {}
        """By wave; where reports on waves are read, these say more."""
        self._answers = answers
        self._timed: list[tuple[int, wire.Message]] = []  # when sent
        self._literals: dict[int, NDArray[np.bool_]] = {}
        self._range = range(first, last + 1)
        self._sensors = len(options.sensors)
        self._waves = Waves(self._sensors) if with_waves else None
        self._gather(tick_index)

    def moment(self, tick: int) -> float | None:
        """Return when a tick was observed, in seconds since 1970.

        None where that is not known: a file without times was observed before its run.
        """
        seen = self.observations.get(tick)
        if seen is None or not (seen.at or not is_file(self.options.source)):
            return None
        return seen.at or self.sent[tick] / 1e9

    @cached_property
    def behind(self) -> dict[int, Behind]:
        """How far ticks were behind their readings, of those that were."""
        times, timed = TickTimes(), sorted(self._timed, key=lambda each: each[0])
        told = (times.take(said, sent / 1e9) for sent, said in timed)
        return {each.tick: each for each in told if each is not None}

    def literals(self, tick: int) -> NDArray[np.bool_]:
        """Return the literals observed at a tick: ``(2N,)``; none if that is unknown.

        It is where the observation is not recorded, or is of other sensors.
        """
        observation = self.observations.get(tick)
        if observation is None:
            return np.zeros(2 * self._sensors, np.bool_)
        if tick not in self._literals:
            try:
                found = selection(
                    *unpack_readings(observation.bits, observation.known, self._sensors)
                )
            except ShapeError:
                found = np.zeros(2 * self._sensors, np.bool_)
            self._literals[tick] = found
        return self._literals[tick]

    def anomaly(self, tick: int, body: Body) -> api.AnomalyView | None:
        """Return what people are told of a tick's anomaly; None if that is nothing.

        Raises:
            MessageError: It is no anomaly of such sensors.
        """
        anomaly = self.anomalies.get(tick)
        told = anomaly and with_support(anomaly, self.options.support)
        if told is None:
            return None
        rule = broken_rule(told)
        return api.AnomalyView(
            culprits=list(told.culprits),
            others=[each for each in told.candidates if each not in told.culprits],
            sentence=named_anomaly(told, body).sentence,
            rule=None if rule is None else (rule.source, rule.target),
        )

    def waves(self, tick: int) -> Iterator[api.WaveView]:
        """Yield the waves of a tick, oldest first, their hops in no order."""
        if self._waves is not None:
            yield from self._waves.of(tick, self.signal(tick))

    def unsettled(self, tick: int) -> list[wire.WaveStart]:
        """Return the waves of a tick of which more may be reported, oldest first."""
        if self._waves is None:
            return []
        return self._waves.unsettled(tick, self.signal(tick))

    def contradicted(
        self, state: wire.State, held: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return which sensors are contradicted: a state has neither of their literals.

        Such a sensor was read; or it was not, and the wave reached both of its
        literals, as far as reports on it were read. ``(N,)``; the state, of one of
        these ticks, holds ``(2N,)``.
        """
        reached = np.zeros(2 * self._sensors, np.bool_)
        if self._waves is not None:
            reached[[*self._waves.reached(state.wave)]] = True
        read = self.literals(state.tick)
        said = read[::2] | read[1::2] | (reached[::2] & reached[1::2])
        return said & ~(held[::2] | held[1::2])

    def signal(self, tick: int) -> tuple[int, ...]:
        """Return the literals that start a tick's state wave."""
        return tuple(self.literals(tick).nonzero()[0].tolist())

    def _gather(self, tick_index: TickIndex) -> None:
        first, last = self._range[0], self._range[-1]
        closing = tick_index.recording.closing
        if closing is not None and closing.tick in self._range:
            self.decisions[closing.tick] = closing
        behind = tick_index.chunk_after(last)
        for number, chunk in tick_index.readable(
            tick_index.chunk_of(first) - 1, behind + _BEYOND + 1
        ):
            self._take(chunk)
            if number > behind and self._is_whole():
                return

    def _take(self, chunk: ChunkMessages) -> None:
        """Take over what a chunk has of these ticks."""
        observed = chunk.all("observation", wire.Observation)
        late = self._waves and any(each.due for each in observed)
        for topic in ("observation", "wavestart", "state", "reached", "decision"):
            timed = chunk.of_topic(topic) if late else ()
            self._timed += ((sent, said) for said, _, _, sent, _ in timed)
        for seen, _, _, sent, _ in chunk.of_topic("observation"):
            if isinstance(seen, wire.Observation) and seen.tick in self._range:
                self.observations.setdefault(seen.tick, seen)
                self.sent.setdefault(seen.tick, sent)
        for state in chunk.all("state", wire.State):
            if state.tick in self._range:
                self.states.setdefault(state.tick, state)
        for decision in chunk.all("decision", wire.Decision):
            if decision.tick in self._range:
                self.decisions.setdefault(decision.tick, decision)
        for anomaly in chunk.all("anomaly", wire.Anomaly):
            if anomaly.tick in self._range:
                self.anomalies.setdefault(anomaly.tick, anomaly)
        if self._answers is not None:
            self._answers.take(chunk, self._range)
        if self._waves is None:
            for reached in chunk.all("reached", wire.Reached):
                if reached.tick in self._range:
                    self.reached.setdefault(reached.wave, reached)
        else:
            for start in chunk.all("wavestart", wire.WaveStart):
                if start.tick in self._range:
                    self._waves.begin(start)
            self._waves.report(chunk.all("cellreport", wire.CellReport))
            self._waves.report(chunk.all("workerreport", wire.WorkerReport))

    def _is_whole(self) -> bool:
        """Return whether all is there that these ticks can have."""
        # A decision is the last that is said on a tick; a run's last tick has none.
        if min(len(self.states), len(self.decisions)) < len(self._range):
            return False
        return not any(map(self.unsettled, self._range))


def conditions(tick_index: TickIndex, ticks: Ticks, tick: int) -> NDArray[np.uint8]:
    """Return what each sensor was at a tick: ``(N,)``, of this module's constants.

    The recording is asked for the wave where only that can tell.
    """
    count = ticks.options.body.count
    found = np.full(count, NOT_RECORDED, np.uint8)
    state = ticks.states.get(tick)
    if state is None:
        return found
    try:
        held = unpack(state.literals, 2 * count)
    except ShapeError:
        return found  # it is of other sensors
    on, off = held.reshape(-1, 2).T
    read = ticks.literals(tick).reshape(-1, 2).any(axis=1)
    against = ticks.contradicted(state, held)
    if state.incoherent and not (on | off | against).all():
        # Others may say of a sensor that was not read that it is on, and that it is
        # off; `ticks` may be without waves.
        with suppress(RecordingError):
            waves = Ticks(tick_index, ticks.options, tick, tick)
            against = waves.contradicted(state, held)
    found[:] = np.where(against, CONTRADICTED, UNKNOWN)
    found[on] = np.where(read, ON, ON_PREDICTED)[on]
    found[off] = np.where(read, OFF, OFF_PREDICTED)[off]
    return found
