"""Bodies: the sensors and actions of an agent, contextual sensors included.

``α∧a`` is on iff action ``α`` was taken in the step that has just ended and literal
``a`` was in the state recorded before it. With it, what an action leads to where
becomes an implication like any other, ``α∧a → b``, which a snapshot can learn.

A *grown* contextual sensor has several literals, ``α∧(a₁∧…∧aₖ)``. It is on iff ``α``
was taken where all of them held. One of them may be an action or a contextual sensor,
on in the state before, which is about the step before that: in ``α∧(β∧b)``, ``α`` was
taken after ``β`` was taken where ``b`` held. A body gets these sensors one by one while
it lives. It has room for so many from the start, behind all other sensors: no number
ever changes, and what is not grown yet reads nothing.

A body whose actions are not sensed in context grows *windows*, each on iff some
literals were read at each of some ticks: ``a₁∧…∧aₖ`` now, ``a`` for the last 3 ticks
and this one, or ``a`` 3 ticks ago.

Some grown sensors are *carried*: what they read is told by what they read before.

References:
    [GK] "Algorithm: Computing the consequences of an action", eqn:context, where a
    context may be of any sensor. Grown sensors are not the paper's, which names them as
    future work ("chunking").
"""

import functools
from collections.abc import Sequence
from itertools import count, pairwise

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.check_grown import check_grown
from neurosnap.agent.clones import Map, MapOfSensors
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import Sensorium

_SHOWN = 2  # sensors that the name of a clone has
_FOR_LATCHES = 40  # of so many places one is kept for latches


# dict: names are derived once.
class Body(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """What an agent senses: its world's sensors, its actions, its actions in context.

    The sensors stand in this order. A contextual sensor is called ``action&sensor``,
    or ``action&~sensor`` where its literal is a complement; a grown one has all its
    literals in its name, as in ``left&row<1&(up&~ice)``, or ``belt for 3 ticks``, and a
    number if it is grown again.

    Raises:
        InvalidValueError: Two sensors have the same name, or a context names an action
            or a literal that does not exist, or one is grown of a single literal of the
            world's own, or of some whose single contexts are not sensed.
    """

    own: tuple[str, ...]
    """The names of the world's own sensors."""
    orders: tuple[int, ...] = ()
    """For each, how many steps it looks back: 0 for a state sensor, 1 for a transition
    sensor; none at all if all are state sensors."""
    actions: tuple[str, ...] = ()
    """The names of the world's actions; exactly one is taken at each step."""
    senses_actions: bool = False
    """Whether each action is a sensor, on after the step it was taken in."""
    context: tuple[tuple[int, int], ...] = ()
    """The contextual sensors: each an action, and a literal of the world's own."""
    room: int = 0
    """How many sensors may be grown."""
    grown: tuple[Context, ...] = ()
    """Those that were, in that order."""
    retired: tuple[int, ...] = ()
    """The places in `grown` of those that are not read any more, ascending."""

    def __post_init__(self) -> None:
        if self.orders and len(self.orders) != len(self.own):
            rule = f"must be one for each of {len(self.own)} sensors"
            raise InvalidValueError("orders", rule, self.orders)
        if any(order < 0 for order in self.orders):
            raise InvalidValueError("orders", "must be 0 or more", self.orders)
        for action, literal in self.context:
            if not 0 <= action < len(self.actions):
                rule = f"must be of one of {len(self.actions)} actions"
                raise InvalidValueError("context", rule, (action, literal))
            if not 0 <= literal < 2 * len(self.own):
                rule = f"must be of a literal of {len(self.own)} sensors"
                raise InvalidValueError("context", rule, (action, literal))
        check_grown(self)
        places = range(len(self.grown))
        looked_back_at = {
            a >> 1
            for each in self.in_use
            for a in (*each.literals, each.reset)
            if a >= 0
        }
        if looked_back_at & {self.first_grown + place for place in self.retired}:
            rule = "must not be looked back at by one that is read"
            raise InvalidValueError("retired", rule, self.retired)
        if any(a >= b for a, b in pairwise(self.retired)) or not set(
            self.retired
        ).issubset(places):
            rule = f"must be places in {len(places)} grown sensors, ascending"
            raise InvalidValueError("retired", rule, self.retired)
        if len(set(self.actions)) < len(self.actions):
            raise InvalidValueError(
                "actions", "must have different names", self.actions
            )
        Sensorium(self.sensors)

    @classmethod
    def full(
        cls,
        own: Sequence[str],
        actions: Sequence[str],
        orders: Sequence[int] = (),
        room: int = 0,
    ) -> "Body":
        """Return the body with every action in the context of every position literal.

        Position literals are those of state sensors. Where there are no actions, there
        is nothing to add.

        Examples:
            >>> Body.full(["door"], ["push"]).sensors
            ('door', 'push', 'push&door', 'push&~door')
        """
        orders = tuple(orders) or (0,) * len(own)
        position = [
            literal
            for sensor, order in enumerate(orders)
            if order == 0
            for literal in (2 * sensor, 2 * sensor + 1)
        ]
        return cls(
            own=tuple(own),
            orders=orders,
            actions=tuple(actions),
            senses_actions=bool(actions),
            room=room,
            context=tuple(
                (action, literal)
                for action in range(len(actions))
                for literal in position
            ),
        )

    def grow(self, context: Context) -> "Body":
        """Return the body with the next of its free places taken.

        Raises:
            InvalidValueError: There is no room, or it cannot be grown.

        Examples:
            >>> body = Body.full(["door", "dark"], ["push"], room=2)
            >>> body.grow(Context(0, (0, 3))).sensors[-2:]
            ('push&door&~dark', 'grown 2')
            >>> body = Body(own=("belt", "gate"), room=2).grow(Context(-1, (0, 3)))
            >>> body.grow(Context(-1, (1,), since=3)).sensors[-2:]
            ('belt&~gate', '~belt for 3 ticks')
        """
        return msgspec.structs.replace(self, grown=(*self.grown, context))

    def retire(self, place: int) -> "Body":
        """Return the body with one of its grown sensors not read any more.

        Its number is not used again.
        """
        retired = tuple(sorted({*self.retired, place}))
        return msgspec.structs.replace(self, retired=retired)

    @property
    def in_use(self) -> tuple[Context, ...]:
        """The grown sensors that are read."""
        return tuple(
            context
            for place, context in enumerate(self.grown)
            if place not in self.retired
        )

    @property
    def first_grown(self) -> int:
        """The number of the first sensor that is grown."""
        felt = len(self.actions) * self.senses_actions
        return len(self.own) + felt + len(self.context)

    @property
    def count(self) -> int:
        """How many sensors there are, ``N``, with those still to be grown."""
        return self.first_grown + self.room

    @property
    def size(self) -> int:
        """How many sensors there are, without those still to be grown."""
        return self.first_grown + len(self.grown)

    @property
    def read(self) -> tuple[int, ...]:
        """The numbers of the sensors that are read: neither to be grown nor retired."""
        retired = {self.first_grown + place for place in self.retired}
        return tuple(sensor for sensor in range(self.size) if sensor not in retired)

    @property
    def has_room(self) -> bool:
        """Whether a further context can be grown: no number is given again.

        Of a large room some places are kept for latches.
        """
        return len(self.grown) < self.room - self.room // _FOR_LATCHES

    def read_for(self, sensor: int) -> tuple[int, ...]:
        """Return the world's own sensors that a window reads; another's own number."""
        place = sensor - self.first_grown
        if self.context or not 0 <= place < len(self.grown):
            return (sensor,)
        return tuple(a >> 1 for a in self.grown[place].literals)

    def split(
        self, literals: tuple[int, ...]
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the literals of a context that are of the world's own, and the others.

        The others tell of the step before.
        """
        first = 2 * len(self.own)
        now = tuple(a for a in literals if a < first)
        return now, tuple(a for a in literals if a >= first)

    def members(self, context: Context) -> list[int]:
        """Return the literals of a step that make a context, but for those before it.

        They are the action, if it is sensed, and its single contexts; of a window the
        literals, if it ends now.
        """
        if context.action < 0:
            is_read_now = context.until < 1 > context.reset and not context.among
            return list(context.literals) if is_read_now else []
        action, literals, *_ = context
        now, _ = self.split(literals)
        first = self.first_grown - len(self.context)
        felt = [2 * (len(self.own) + action)] if self.senses_actions else []
        return felt + [2 * (first + self.context.index((action, a))) for a in now]

    def reading(self, context: Context, state: NDArray[np.bool_]) -> bool | None:
        """Return what a grown sensor reads, as far as a state tells.

        Args:
            context: Its context.
            state: ``(2N,)``, of the step that ended.

        Returns:
            None if that depends on what is not in the state: on the step before, say.
        """
        if context.reset >= 0 or context.among:
            return None
        members = self.members(context)
        if state[[a ^ 1 for a in members]].any():
            return False
        _, before = self.split(context.literals)
        told = not (before or context.since)
        return True if told and state[members].all() else None

    @functools.cached_property
    def sensors(self) -> tuple[str, ...]:
        """The names of all sensors, in order."""
        felt = self.actions if self.senses_actions else ()
        single = (self._name(Context(action, (a,))) for action, a in self.context)
        names = [*self.own, *felt, *single]
        for number in range(self.first_grown, self.size):
            name = self._before(number)
            ways = (f"{name}#{k}" if k > 1 else name for k in count(1))
            names.append(next(way for way in ways if way not in names))
        free = (f"grown {place + 1}" for place in range(len(self.grown), self.room))
        return (*names, *free)

    def _name(self, context: Context) -> str:
        action, literals, since, until, reset, *_ = context
        if reset >= 0:
            return " until ".join(map(self._sensation, (*literals, reset)))
        now, before = self.split(literals)
        done = (self.actions[action],) if action >= 0 else ()
        named = (f"{'~' * (a & 1)}{self.own[a >> 1]}" for a in now)
        told = (f"({self._sensation(a)})" for a in before)
        name = "&".join((*done, *named, *told))
        if not since:
            return name
        ticks = f"{since} tick{'s' * (since > 1)}"
        if not until:
            return f"{name} for {ticks}"
        ended = f" to {until}" * (until < since)
        return f"{name} {since}{ended} tick{'s' * (since > 1)} ago"

    def believed(self, sensor: int) -> str:
        """Return what a grown sensor is believed from that nothing reads.

        Empty: it is read, from what was done and read in the last ticks.

        Examples:
            >>> body = Body.full(["red", "dark"], ["go"], room=2)
            >>> first = body.first_grown
            >>> body = body.grow(Context(-1, (0,), reset=2))
            >>> body.believed(first)
            'on once red is, until dark is'
            >>> clone = Context(-1, (0, 3), ways=(0, first + 1), among=(first + 1, 1))
            >>> body.grow(clone).believed(first + 1)
            'one place of 1, with red&~dark; go leads here from @1'
        """
        context = self.grown[sensor - self.first_grown]
        if context.reset >= 0:
            on, off = map(self._sensation, (*context.literals, context.reset))
            return f"on once {on} is, until {off} is"
        if not context.among:
            return ""
        first, size = context.among
        look = "&".join(map(self._sensation, context.literals))
        ways = zip(context.ways[::2], context.ways[1::2], strict=True)
        led = [
            f"{self.actions[way]} leads here from @{k - first + 1}" for way, k in ways
        ]
        return "; ".join((f"one place of {size}, with {look}", *led))

    def _sensation(self, literal: int) -> str:
        """Return the name of a literal of any sensor."""
        sensor = literal >> 1
        name = self.own[sensor] if sensor < len(self.own) else self._before(sensor)
        return "~" * (literal & 1) + name

    def _before(self, sensor: int) -> str:
        """Return the name of an action or of a contextual sensor."""
        felt = self.actions if self.senses_actions else ()
        if sensor >= self.first_grown:
            context = self.grown[sensor - self.first_grown]
            if context.among:
                on = [self.own[a >> 1] for a in context.literals if not a & 1]
                return f"{'&'.join(on[:_SHOWN])}@{sensor - context.among[0] + 1}"
            return self._name(context)
        place = sensor - len(self.own)
        if place < len(felt):
            return felt[place]
        action, literal = self.context[place - len(felt)]
        return self._name(Context(action, (literal,)))

    @property
    def looked_at(self) -> NDArray[np.bool_]:
        """``(2N,)``: the literals that tell apart what actions may lead to.

        Those of the world's state sensors, and those of the step before that a grown
        sensor looks at.
        """
        mask = self.position
        for context in self.in_use:
            if context.reset < 0 and not context.among:
                mask[list(self.split(context.literals)[1])] = True
        for carried in self.carries:
            mask[[2 * carried, 2 * carried + 1]] = True
        return mask

    @functools.cached_property
    def latches(self) -> tuple[tuple[Context, int], ...]:
        """The latches that are read, and their numbers, ascending."""
        return tuple(
            (context, self.first_grown + place)
            for place, context in enumerate(self.grown)
            if context.reset >= 0 and place not in self.retired
        )

    @functools.cached_property
    def maps(self) -> tuple[MapOfSensors, ...]:
        """The maps of which all clones are there and read, in the order they came."""
        retired = {self.first_grown + place for place in self.retired}
        every = dict.fromkeys(each.among for each in self.grown if each.among)
        return tuple(
            self._map(first, size)
            for first, size in every
            if first + size <= self.size
            and retired.isdisjoint(range(first, first + size))
        )

    def _map(self, first: int, size: int) -> MapOfSensors:
        place = first - self.first_grown
        clones = self.grown[place : place + size]
        looks = np.array([each.literals for each in clones], np.intp)
        leads = np.full((len(self.actions), size), -1, np.int64)
        for number, each in enumerate(clones):
            ways = np.array(each.ways, np.intp).reshape(-1, 2)
            leads[ways[:, 0], ways[:, 1] - first] = number
        return MapOfSensors(first, looks[0] >> 1, Map(looks & 1 == 0, leads))

    @functools.cached_property
    def carries(self) -> tuple[int, ...]:
        """The carried sensors that are read, ascending."""
        clones = (k for one in self.maps for k in one.numbers)
        return tuple(sorted((*(latch for _, latch in self.latches), *clones)))

    def carried(
        self, before: NDArray[np.bool_], state: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return a state, ``(2N,)``, with what is carried from the one before.

        A latch is on if its literal is in the state, or if it was on before and the
        complement of its reset is; off if the complement of its literal is in the state
        and so is its reset, or it was off before. Otherwise nothing is said of it. A
        clone is off where the state excludes its look, or no clone that was not off
        before leads there by the action in the state; on if all others are off. What
        all that are not off look like is in the state as well.
        """
        if not self.carries:
            return state
        state = state.copy()
        for context, latch in self.latches:
            (a,), reset = context.literals, context.reset
            on, off = before[[2 * latch, 2 * latch + 1]]
            state[2 * latch] = state[a] or (on and state[reset ^ 1])
            state[2 * latch + 1] = state[a ^ 1] and (off or state[reset])
        own = len(self.own)
        taken = np.flatnonzero(state[2 * own : 2 * (own + len(self.actions)) : 2])
        for one in self.maps:
            one.carry(before, state, taken[0].item() if len(taken) else -1)
        return state

    @property
    def position(self) -> NDArray[np.bool_]:
        """``(2N,)``: the literals of the world's state sensors."""
        orders = self.orders or (0,) * len(self.own)
        rest = self.count - len(self.own)
        flat = np.array([order == 0 for order in orders] + [False] * rest, np.bool_)
        return np.repeat(flat, 2)
