"""Decides at each tick which sensor to grow or to retire, from past readings."""

from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.grower import Grower
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.map_grower import MapGrower
from neurosnap.agent.window_grower import WindowGrower
from neurosnap.errors import MessageError
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import (
    History,
    Newborn,
    as_ring,
    conjunction,
    following,
    latch,
    window,
)
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Words
from neurosnap.sensorium import selection
from neurosnap.wire import Decision

_EVERY = 8  # ticks from one look at whether a sensor is needed to the next


class Growth:
    """Finds the next sensor to grow or to retire.

    By what each action led to; or, where actions are not sensed, by what relates the
    readings.

    Args:
        body: What is sensed and done, with room for what is grown.

    Attributes:
        history: The last readings of every sensor.
        was_on: ``(room,)``: at how many ticks each grown sensor read on, or would have.
        changes: What the decision of the tick under way says of growth, by field.

    """

    def __init__(self, body: Body) -> None:
        self._grower = Grower(body) if body.context else WindowGrower(body)
        self._maps = MapGrower(body)
        ticks = wire.HISTORY_OF_ACTIONS if body.context else wire.HISTORY
        self.history = History(len(body.sensors), ticks)
        self.was_on = np.zeros(body.room, np.int64)
        self._own = len(body.own)
        self._body = body
        self.changes: dict[str, Any] = {}

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._grower.fit(body)
        self._maps.fit(body)
        self._body = body

    @property
    def hopeless(self) -> NDArray[np.bool_]:
        """``(actions, 2n)``: which results seem to be left to chance."""
        if isinstance(self._grower, Grower):
            return self._grower.hopeless
        return np.zeros((len(self._body.actions), 2 * self._own), np.bool_)

    @property
    def surprising(self) -> NDArray[np.float64]:
        """``(actions, 2n)``: how often each result came unforeseen of late: a share."""
        if isinstance(self._grower, Grower):
            return self._grower.surprising
        return np.zeros((len(self._body.actions), 2 * self._own))

    def record(
        self,
        observation: NDArray[np.bool_],
        known: NDArray[np.bool_] | None,
        begins: bool,
        ended: bool,
    ) -> None:
        """Record an observation, ``(N,)``; see `History.record`."""
        self.history.record(observation, known, begins, ended)
        on = observation if known is None else observation & known
        self.was_on += on[self._body.first_grown :]

    def notice(
        self,
        action: int,
        state: NDArray[np.bool_],
        foretold: NDArray[np.bool_],
        observation: NDArray[np.bool_],
        known: NDArray[np.bool_] | None,
        snapshot: Snapshot,
    ) -> Search[None]:
        """Prepare what the decision on an observation says.

        One sensor is grown at most, or one retires.

        Args:
            action: That of the step that has ended; -1: none was.
            state: ``(2N,)``, recorded before it.
            foretold: ``(2n,)``, what the action guaranteed of the world's own sensors.
            observation: ``(N,)``; it is learned by now, and in the history.
            known: ``(N,)``, which of it is known; if None, all.
            snapshot: Weighs what is born.
        """
        self.changes = {}
        due: Context | None = None
        if isinstance(self._grower, WindowGrower):
            due = yield from self._grower.find(self.history, snapshot)
        else:
            came = selection(observation, known)[: 2 * self._own]
            due = yield from self._notice(self._grower, action, state, foretold, came)
        if due is None:
            yield from self._retire(snapshot.poc_graph())
        else:
            yield from self._bear(due, snapshot)

    def _notice(
        self,
        grower: Grower,
        action: int,
        state: NDArray[np.bool_],
        foretold: NDArray[np.bool_],
        came: NDArray[np.bool_],
    ) -> Search[Context | None]:
        """Find the sensor that is due by what an action led to; see `notice`."""
        hopeless, unexplained = grower.hopeless, 0
        if action >= 0:
            step = action, state, foretold, came
            past = self.history.tick, self.history.begun
            unexplained = yield from grower.notice(*step, *past)
            given_up = grower.hopeless[action] & ~hopeless[action]
            if given_up.any():
                self.changes["chance"] = tuple(np.flatnonzero(given_up).tolist())
        coins = np.logical_and.reduce(hopeless.reshape(-1, self._own, 2), axis=(0, 2))
        clone = yield from self._maps.find(self.history, unexplained, coins)
        return clone or (grower.birth() if action >= 0 else None)

    def _bear(self, context: Context, snapshot: Snapshot) -> Search[None]:
        """Find out what a sensor would have read, and what its weights would be."""
        body, history = self._body, self.history
        sensor = body.first_grown + len(body.grown)
        on, off = yield from self._readings(context)
        unread = [body.first_grown + place for place in body.retired]
        newborn = yield from snapshot.newborn(sensor, history.ticks, on, off, unread)
        history.on[:, sensor], history.off[:, sensor] = on, off
        self.was_on[len(body.grown)] = np.bitwise_count(on).sum()
        names = "context", "literals", "since", "until", "reset", "ways", "among"
        self.changes |= {"born": sensor} | dict(zip(names, context, strict=True))
        self.changes |= birth_fields(newborn, snapshot)

    def _readings(self, context: Context) -> Search[tuple[Words, Words]]:
        """Return at which ticks a sensor would have been on, and off: ``(W,)`` each."""
        history, begun, tick = self.history, self.history.begun, self.history.tick
        if context.among:
            on, off = yield from self._maps.readings(context, history)
            return as_ring(on, tick, len(begun)), as_ring(off, tick, len(begun))
        is_window, (_, before) = context.action < 0, self._body.split(context.literals)
        members = list(context.literals) if is_window else self._body.members(context)
        if context.reset >= 0:
            members, before = [*context.literals, context.reset], ()
        asked = dict.fromkeys(b for a in (*members, *before) for b in (a, a ^ 1))
        read = (yield Question(readings=tuple(asked))).readings
        if context.reset >= 0:
            return latch(read, members[0], members[1], begun, tick)
        if is_window:
            return window(read, members, (context.since, context.until), begun, tick)
        return conjunction(read, members, before, tick)

    def _retire(self, graph: PocGraph) -> Search[None]:
        """Look at one grown sensor every few ticks; prepare that it retires."""
        body = self._body
        turn, rest = divmod(self.history.tick, _EVERY)
        if rest or not body.grown:
            return
        place = turn % len(body.grown)
        mine = 2 * (body.first_grown + place)
        needed = any(  # looked back at
            {mine, mine + 1} & {*each.literals, each.reset} for each in body.in_use
        )
        if isinstance(self._grower, Grower):
            needed = needed or mine >> 1 in self._grower.awaited
        if place in body.retired or needed:
            return
        if body.grown[place].among:
            newer = body.maps and mine >> 1 < body.maps[-1].first
            if newer:
                self.changes["retires"] = mine >> 1
            return
        if body.grown[place].reset >= 0:
            if body.has_room:  # else it tells places apart by itself
                self.changes["retires"] = mine >> 1
            return
        was_on = int(self.was_on[place]), self.history.tick
        if (yield from is_needless(body, place, graph, *was_on)):
            self.changes["retires"] = body.first_grown + place

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        kept = self.history.arrays() | {"was_on": self.was_on}
        return kept | self._grower.arrays() | self._maps.arrays()

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays; ValueError if they make no sense."""
        self.history = History.from_arrays(
            arrays, len(self._body.sensors), self.history.length
        )
        self.was_on = entry(arrays, "was_on", self.was_on.shape, np.int64).copy()
        self._grower.restore(arrays)
        self._maps.restore(arrays)


def apply_change(body: Body | None, decision: Decision, snapshot: Snapshot) -> None:
    """Grow or retire a sensor of a snapshot, by a decision and the body after it.

    Without a body the sensor's name stays, and what it reads is left out: for a share
    of the pairs, which needs neither.

    Raises:
        MessageError: What is said of a newborn is not of the sensors before it.
    """
    if decision.born >= 0:
        sensor = decision.born
        kind = "<u4" if isinstance(snapshot, EmpiricalSnapshot) else "<f8"
        try:
            squares = np.frombuffer(decision.weights, kind).reshape(4, sensor)
            codes = np.frombuffer(decision.codes, np.uint8)
            newborn = Newborn(decision.history, squares, codes)
            name, reads = snapshot.sensorium.names[sensor], None
            if body is not None:
                name = body.sensors[sensor]
                reads = body.reading(body.grown[-1], snapshot.state)
            snapshot.grow(sensor, name, newborn, reads)
        except ValueError as error:
            raise MessageError(f"decision: born: {error}") from error
    if decision.retires >= 0:
        snapshot.silence(decision.retires)


def birth_fields(newborn: Newborn, snapshot: Snapshot) -> dict[str, int | bytes]:
    """Return the fields of a decision that describe a newborn sensor."""
    kind = "<u4" if isinstance(snapshot, EmpiricalSnapshot) else "<f8"
    return {
        "history": newborn.ticks,
        "weights": newborn.squares.astype(kind).tobytes(),
        "codes": newborn.codes.tobytes(),
    }


def is_needless(
    body: Body, place: int, graph: PocGraph, was_on: int, ticks: int
) -> Search[bool]:
    """Tell whether a grown sensor, by its place among these, is to retire.

    What it guarantees of the world's own sensors, or a window of any, a part of its
    context guarantees as well. Or, but for windows, each of these was guaranteed,
    whenever it was on, by some other sensor that was on, too, or by the last map: so a
    map, or several wide contexts, take the place of a narrow one that came first. If
    they do not where the agent has not been yet, that is a surprise, and it is grown
    again. It costs some `PocGraph.up`, and rings of the history.

    Args:
        body: What is sensed.
        place: The sensor's.
        graph: What is believed.
        was_on: At how many ticks it was on.
        ticks: How many there were so far.
    """
    alone = _guarantees_alone(body, place, graph)
    if alone and body.context:
        alone = yield from _not_covered(body, place, alone, graph, was_on, ticks)
    return not alone


def _guarantees_alone(body: Body, place: int, graph: PocGraph) -> list[int]:
    """Return what a grown sensor guarantees that no part of its context does."""
    context, first = body.grown[place], 2 * body.first_grown
    part = body.members(context)
    for other, smaller in enumerate(body.grown):
        if other not in {place, *body.retired} and context.includes(smaller):
            part.append(first + 2 * other)
    closures = graph.up([first + 2 * place]), graph.up(part)
    whole, rest = guaranteed(closures)
    whole[first + 2 * place] = False
    read = 2 * len(body.own) if body.context else len(whole)
    return np.flatnonzero(whole[:read] & ~rest[:read]).tolist()


def _not_covered(
    body: Body,
    place: int,
    results: list[int],
    graph: PocGraph,
    counted: int,
    ticks: int,
) -> Search[list[int]]:
    """Return which results of a sensor others did not always guarantee when it was on.

    It was on so often as is `counted`. So does a map that knew where it was before.
    """
    mine = 2 * (body.first_grown + place)
    action, actions = body.grown[place].action, Actions(body)
    may_be_on = actions.signal(action, actions.in_use)
    others = [a for a in may_be_on if a != mine]
    by: dict[int, list[int]] = {}
    led: dict[int, list[int]] = {}
    for result in results:
        # a -> r if and only if r* -> a*
        less, more = graph.up([result ^ 1]), graph.up([result])
        by[result] = [a for a in others if less[a ^ 1] and not more[a ^ 1]]
        led[result] = [
            2 * clone for one in body.maps[-1:] for clone in one.leading(action, result)
        ]
        if not by[result] and not led[result]:
            return results
    asked = dict.fromkeys([mine, *chain(*by.values(), *led.values())])
    read = (yield Question(readings=tuple(asked))).readings
    was_on = read[mine]
    remembered = int(np.bitwise_count(was_on).sum())
    if not remembered:
        return results
    # Where it has not been for longer than the history is, others may be missing:
    # the sensor would retire, be missed, and be grown again, time and again.
    if counted > remembered:
        return results
    left = {result: was_on.copy() for result in results}
    for result, uncovered in left.items():
        for a in by[result]:
            uncovered &= ~read[a]
        for a in led[result]:
            uncovered &= ~following(read[a], ticks)
    return [result for result, uncovered in left.items() if uncovered.any()]
