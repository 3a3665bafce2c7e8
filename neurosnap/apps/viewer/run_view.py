"""Everything that the page shows of a recorded run, tick by tick.

Nothing is derived again that was recorded: the state of a tick is the one the recording
has, which is the one that `neurosnap verify` derives. Only the learned order is worked
out, by learning what was observed from the nearest key-frame on.
"""

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import changes_in
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.learned_by_tick import SnapshotCache, drawn, graph_id
from neurosnap.apps.viewer.slow_cells import Answers, not_waiting
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.apps.viewer.waves import Imagined, first_shown, in_order, plan_of
from neurosnap.apps.viewer.world_scene import Scene
from neurosnap.errors import InvalidValueError, MessageError, RecordingError, ShapeError
from neurosnap.protocol.tick_times import Behind
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learn_again import Learning
from neurosnap.sensorium import unpack
from neurosnap.sources.live.statistics import outage_line, received_line
from neurosnap.sources.meaning import compared, numbers_in
from neurosnap.sources.open import STDIN
from neurosnap.system.local_time import dated

_BACK = 8
"""Images that are looked for, at most: one may be lost, and so many not in a row."""
_READINGS = 15_000
"""Readings of sensors in the ticks that are read at once, about."""
_BITS: tuple[api.Bit, ...] = (None, 0, 1, None)
_UNKNOWN = ""
"""The id of an order that cannot be known: an observation is missing."""


class RunView:
    """A recording to look at. To be used by one thread at a time.

    Args:
        path: The recording: whole, cut short, or growing.
        other: A view of the same recording: what can be shared with it is.

    Raises:
        RecordingError: It cannot be read, or is not a run's.
    """

    def __init__(self, path: Path, other: Self | None = None) -> None:
        self.path = path
        self.recording = Recording.open(path, verify=False)
        self.options = self.recording.options
        lessons = None if other is None else other.tick_index.lessons
        self.tick_index: TickIndex = TickIndex(self.recording, lessons)
        self.recall = SnapshotCache(self.tick_index, self.options)
        self.scene: Scene = Scene(self.options) if other is None else other.scene
        self._image: wire.Image | None = None  # the last that was found
        self.first = self._first()
        self.last = self.tick_index.last_tick()
        self.grown = 0
        """How often there was more."""
        self._names = self.options.body.actions
        conditions = self.options.conditions
        own = [conditions.get(name) for name in self.options.body.own]
        self._compared = compared(own)
        self._imagined = Imagined(self.options.body)

    def grow(self) -> bool:
        """Look at what the file has gained; return whether that is anything.

        Raises:
            RecordingError: The file cannot be read.
        """
        if not self.tick_index.grow():
            return False
        self.first = self._first()
        self.last = max(self.last, self.tick_index.last_tick())
        self.grown += 1
        return True

    def cut(self, *, live: bool) -> str | None:
        """Return what is missing from a recording that is not whole.

        Args:
            live: It still grows: that it has no end yet is nothing to say.
        """
        if live and not self.recording.spoiled:
            return None
        lost = [*self.recording.lost, *self.tick_index.damage.values()]
        if not lost and not self.recording.whole:
            lost = ["messages are missing; neurosnap info counts them"]
        return "; ".join(lost) or None

    def run(self, live: bool) -> api.Run:
        """Return what is being looked at; it still grows if it is live."""
        options = self.options
        return api.Run(
            log=self.path.name,
            source="standard input" if options.source == STDIN else options.source,
            sensors=options.sensors,
            room=options.body.room,
            actions=self._names,
            options=msgspec.to_builtins(options),
            first=self.first,
            ticks=self.last,
            live=live,
            cut=self.cut(live=live),
            swarm=self.recording.swarm,
            world=self.scene.stage,
        )

    def at_once(self, most: int) -> int:
        """Return how many ticks to read before others have their turn.

        With many sensors each tick takes longer, and there are fewer than `most`.
        """
        return max(5, min(most, _READINGS // max(1, self.options.body.count)))

    def frames(self, first: int, last: int) -> list[api.Frame]:
        """Return the frames of some ticks, but of those whose state is not recorded.

        Args:
            first: Earlier than the first tick there is: from that on.
            last: Later than the last tick there is: up to that.

        Raises:
            RecordingError: A message that is needed is not what it should be.
        """
        first, last = max(first, self.first), min(last, self.last)
        if first > last:
            return []
        ticks = Ticks(self.tick_index, self.options, first, last)
        learned = dict(self._learned(first, last))
        unknown = (_UNKNOWN, self.options.body)
        return [
            self._frame(ticks, ticks.states[tick], *learned.get(tick, unknown))
            for tick in range(first, last + 1)
            if tick in ticks.states
        ]

    def wave(self, tick: int, number: int) -> api.WaveView:
        """Return a wave of a tick with its hops.

        Raises:
            InvalidValueError: The tick has no such wave.
            RecordingError: A message that is needed is not what it should be.
        """
        waves = Ticks(self.tick_index, self.options, tick, tick).waves(tick)
        found = next((wave for wave in waves if wave.wave == number), None)
        if found is None:
            raise InvalidValueError("wave", f"must be a wave of tick {tick}", number)
        return in_order(found)

    def waiting(self) -> api.Waiting | None:
        """Return whom a wave of the last ticks waits for; None: for no part.

        While a run that goes on is being copied, it waits for none.

        Raises:
            RecordingError: A message that is needed is not what it should be.
        """
        last = max(self.first, self.last)
        if self.last < max(self.recording.resumed, default=0):
            return None
        answers = Answers(self.options)
        ticks = Ticks(self.tick_index, self.options, last, last + 1, answers=answers)
        for tick in (last, last + 1):
            for start in ticks.unsettled(tick)[:1]:
                observed = ticks.signal(tick)
                silent = answers.silent(start, observed)
                if not (start.signal or self.options.sharing):
                    with suppress(RecordingError):
                        graph = self.recall.at(tick).snapshot.poc_graph()
                        edges = graph.wire_list(self.options.wiring)
                        silent = not_waiting(silent, observed, edges)
                if silent:
                    parts = [answers.parts[part] for part in silent]
                    seconds = time.time() - answers.began(start) / 1e9
                    cells = [(part[0], part[-1]) for part in parts]
                    return api.Waiting(cells, seconds)
        return None

    def graph(self, tick: int) -> api.Graph:
        """Return the learned order after a tick; 0 for before the first.

        Raises:
            InvalidValueError: There is no such tick.
            RecordingError: An observation or a key-frame that is needed is not there.
        """
        learned = self.learned(tick)
        return drawn(tick, learned.snapshot.poc_graph(), learned.body)

    def edge(self, source: int, target: int, tick: int) -> api.Edge:
        """Return what is known of ``source -> target`` after a tick.

        Raises:
            InvalidValueError: There is no such tick, no such literal, or both are of
                one sensor.
            RecordingError: An observation or a key-frame that is needed is not there.
        """
        found = self.learned(tick).snapshot.evidence(source, target)
        return api.Edge(
            source=source,
            target=target,
            tick=tick,
            weights=(found.both, found.against, found.other, found.neither),
            threshold=found.limit,
            holds=found.holds,
            since=found.since,
        )

    def learned(self, tick: int) -> Learning:
        """Return what was learned by a tick, and of which sensors; not to be changed.

        Raises:
            InvalidValueError: There is no such tick.
            RecordingError: An observation or a key-frame that is needed is not there.
        """
        least = 0 if self.first == 1 else self.first
        if not least <= tick <= self.last:
            rule = f"must be in [{least}, {self.last}]"
            raise InvalidValueError("tick", rule, tick)
        return self.recall.at(tick)

    def image(self, tick: int) -> wire.Image | None:
        """Return the last image at a tick or before; None if there is none near.

        Where none is lost, the chunks of one tick are unpacked.
        """
        every = self.options.frames
        if not every or tick < 1:
            return None
        due = tick - (tick - 1) % every
        for taken in range(due, max(0, due - _BACK * every), -every):
            last = self._image
            image = last if last and last.tick == taken else self._image_of(taken)
            if image is not None:
                self._image = image
                return image
        return None

    def _image_of(self, tick: int) -> wire.Image | None:
        """Return the image of a tick.

        Its sender is the world's: it is between the tick's observation and the next.
        """
        index = self.tick_index
        first, last = index.chunk_of(tick), index.chunk_after(tick)
        for _, chunk in index.readable(first, last + 1):
            for image in chunk.all("image", wire.Image):
                if image.tick == tick:
                    return image
        return None

    def _first(self) -> int:
        """Return the first tick that was observed; 1 if none was."""
        for number in range(len(self.tick_index)):
            if observed := self.tick_index.observed(number):
                return min(observation.tick for observation in observed)
        return 1

    def _learned(self, first: int, last: int) -> Iterator[tuple[int, tuple[str, Body]]]:
        """Yield the order's id and the body after each tick, as far as known."""
        tick = first
        while tick <= last:
            try:
                for learned in self.recall.walk(tick, last):
                    tick = learned.tick + 1
                    name = graph_id(learned.snapshot.poc_graph(), learned.body)
                    yield learned.tick, (name, learned.body)
            except RecordingError:
                # Behind the gap it is known again from the next key-frame on.
                tick = self.tick_index.keyframe_after(tick)

    def _frame(
        self,
        ticks: Ticks,
        state: wire.State,
        graph: str,
        body: Body,
    ) -> api.Frame:
        tick = state.tick
        image = self.image(tick)
        observation = ticks.observations.get(tick)
        observed = ticks.literals(tick)
        literals = self._unpacked(state)
        decision = ticks.decisions.get(tick)
        choice = -1 if decision is None else decision.action
        moment = ticks.moment(tick)
        waves = [self._imagined.marked(wave, literals) for wave in ticks.waves(tick)]
        shown = first_shown(waves)
        return api.Frame(
            tick=tick,
            at="" if moment is None else dated(moment, self.options.zone),
            bits=_bits(observed),
            numbers=self._numbers(observation),
            state=_bits(literals),
            contradicted=np.flatnonzero(ticks.contradicted(state, literals)).tolist(),
            action=self._names[choice] if 0 <= choice < len(self._names) else None,
            choice=choice,
            why="" if decision is None else decision.why,
            begins=observation is not None and observation.begins,
            intake=_intake(observation, ticks.behind.get(tick), self.options.zone),
            incoherent=state.incoherent,
            depth=state.depth,
            longest=state.longest,
            height=state.height,
            edges=state.edges,
            pulses=state.pulses,
            graph=graph,
            place=self.scene.place(observed),
            image=None if image is None else image.tick,
            waves=shown,
            left_out=len(waves) - len(shown),
            sensors=body.size,
            retired=[body.first_grown + place for place in body.retired],
            changed=[] if decision is None else list(changes_in(decision, body)),
            plan=plan_of(decision, self._names, self.options.target),
            anomaly=self._anomaly(ticks, tick, body),
        )

    def _anomaly(self, ticks: Ticks, tick: int, body: Body) -> api.AnomalyView | None:
        try:
            return ticks.anomaly(tick, body)
        except MessageError as error:
            place = f"{self.path}: tick {tick}"
            raise RecordingError(f"{place}: /anomaly: {error}") from error

    def _numbers(self, observation: wire.Observation | None) -> dict[int, float]:
        """Return the number that each sensor compared, of those that are known."""
        if observation is None:
            return {}
        return numbers_in(observation.said, self._compared)

    def _unpacked(self, state: wire.State) -> NDArray[np.bool_]:
        try:
            return unpack(state.literals, 2 * self.options.body.count)
        except ShapeError as error:
            place = f"{self.path}: tick {state.tick}"
            raise RecordingError(f"{place}: /state: {error}") from error


def _intake(
    observation: wire.Observation | None, behind: Behind | None, zone: str
) -> list[str]:
    """Say how late a tick is, what was received by then, and when it did not listen."""
    if observation is None:
        return []
    late = [] if behind is None else [behind.line()]
    counts = msgspec.structs.asdict(observation.received)
    came = [received_line(counts)] if observation.received.total else []
    return [*late, *came, *(outage_line(each, zone) for each in observation.outages)]


def _bits(literals: NDArray[np.bool_]) -> list[api.Bit]:
    """Return which sensors a set of literals has on, off, or neither; ``(2N,)``."""
    kinds = literals[::2] * 2 + literals[1::2]
    return [_BITS[kind] for kind in kinds.tolist()]
