"""The observation of an agent: its world's sensors, its actions, and what is grown.

`Contexts` says which contexts hold in a state, and of which one can tell; `Windows`
which windows of the last ticks do.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import complement, selection

_ONE, _NEWEST = np.uint64(1), np.uint64(63)
Readings = tuple[NDArray[np.bool_], NDArray[np.bool_] | None]
"""Which sensors are on, and which readings are known; None if all are."""


class Contexts:
    """Tells which contexts hold in a state, for all contextual sensors at once.

    Attributes:
        action: ``(contexts,)``: the action of each; of one not yet grown, 0.
        in_use: ``(contexts,)``: whether it is read at all.
    """

    def __init__(self, body: Body) -> None:
        free = body.room - len(body.grown)
        actions = [each[0] for each in (*body.context, *body.grown)]
        self.action = np.array([*actions, *(0 for _ in range(free))], np.intp)
        self._free = np.zeros(free, np.bool_)
        self._single = np.array([literal for _, literal in body.context], np.intp)
        many = [each.literals for each in body.grown]
        self._grown = np.array([a for each in many for a in each], np.intp)
        ends = np.cumsum([len(each) for each in many])
        self._starts = np.concatenate(([0], ends))[: len(body.grown)].astype(np.intp)
        # A latch or a clone depends on no action that is taken where its literals held.
        self.in_use = self.action >= 0
        self.in_use[len(actions) :] = False
        self.in_use[[len(body.context) + place for place in body.retired]] = False

    def hold(self, state: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which have all their literals in `state`, and are in use.

        Args:
            state: ``(2N,)``. Where no sensor looks at the step before, the part of it
                that is of the world's own sensors is enough.
        """
        grown = np.logical_and.reduceat(state[self._grown], self._starts)
        holds = np.concatenate((state[self._single], grown, self._free))
        return np.asarray(holds & self.in_use, np.bool_)

    def told(
        self, state: NDArray[np.bool_], known: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return which contexts are known to hold or not to hold: ``(contexts,)``.

        A literal is told where it or its complement is in the state, or its reading was
        known. A context is told where all its literals are, or one that is not in the
        state.

        Args:
            state: ``(2N,)``.
            known: ``(n,)``, which readings of the world's own sensors were known then.
        """
        told = state | complement(state)
        told[: 2 * len(known)] |= np.repeat(known, 2)
        all_told = np.logical_and.reduceat(told[self._grown], self._starts)
        off = (told & ~state)[self._grown]
        one_off = np.logical_or.reduceat(off, self._starts)
        tells = np.concatenate((told[self._single], all_told | one_off, self._free))
        return np.asarray(tells & self.in_use, np.bool_)


class Windows:
    """Keeps the last readings of a world's own sensors, and reads windows of them.

    What came before a beginning is unknown.

    Args:
        body: Its grown sensors are windows.
        history: What was read before.
    """

    def __init__(self, body: Body, history: History | None) -> None:
        # By literal, as `History.last_ticks` returns it.
        self._read = np.zeros(2 * len(body.own), np.uint64)
        if history is not None:
            self._read = history.last_ticks(np.arange(2 * len(body.own)))
        self.fit(body)

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        every = [(a, each) for each in body.grown for a in each.literals]
        self._literals = np.array([a for a, _ in every], np.intp)
        ticks = [(1 << 64 - each.until) - (1 << 63 - each.since) for _, each in every]
        self._ticks = np.array(ticks, np.uint64)
        ends = np.cumsum([0, *(len(each.literals) for each in body.grown)])
        self._starts = ends[:-1].astype(np.intp)
        self._unread = list(body.retired)
        self._room = body.room

    def observe(
        self, bits: NDArray[np.bool_], known: NDArray[np.bool_] | None, begins: bool
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Add readings, ``(n,)``, and return those of the windows, ``(room,)``.

        Returns:
            Which are on, and which are known: on iff all was read so, off if the
            complement of anything was.
        """
        self._read = np.zeros_like(self._read) if begins else self._read >> _ONE
        self._read |= selection(bits, known).astype(np.uint64) << _NEWEST
        whole = self._read[self._literals] & self._ticks == self._ticks
        broken = self._read[self._literals ^ 1] & self._ticks != 0
        on, sure = np.zeros((2, self._room), np.bool_)
        if len(self._starts):
            grown = slice(len(self._starts))
            on[grown] = np.logical_and.reduceat(whole, self._starts)
            sure[grown] = on[grown] | np.logical_or.reduceat(broken, self._starts)
            on[self._unread] = sure[self._unread] = False
        return on, sure


class Senses:
    """Makes an agent's observations from its world's readings and its last actions.

    Args:
        body: What is sensed.
        known: ``(n,)``, which of the world's own readings were known last; None: all.
        history: The readings before, where windows are grown.
    """

    def __init__(
        self,
        body: Body,
        known: NDArray[np.bool_] | None = None,
        history: History | None = None,
    ) -> None:
        self._known = known
        windows = body.room and not body.context
        self._windows = Windows(body, history) if windows else None
        self.fit(body)

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        own, felt = len(body.own), len(body.actions) * body.senses_actions
        self._body = body
        self._own = slice(0, own)
        self._felt = slice(own, own + felt)
        self._contexts = Contexts(body)
        self._count = body.count
        self._contextual = slice(own + felt, self._count)
        self.looks_back = bool(felt or body.context)
        """Whether an observation depends on the step before it."""
        if self._windows is not None:
            self._windows.fit(body)

    def observe(
        self,
        bits: NDArray[np.bool_],
        own: NDArray[np.bool_] | None = None,
        action: int = -1,
        state: NDArray[np.bool_] | None = None,
        begins: bool = False,
    ) -> Readings:
        """Return the whole observation: ``(N,)``, and which of it is known.

        Actions always are. ``α∧a`` is known where ``α`` was not taken, for then it is
        off; where a literal of the sensor was in the state before, even if only because
        something implied it; and where the sensor's reading was known then. (If that
        was contradicted, neither literal was in the state, and ``α∧a`` is off.) One of
        several literals is on or off as the single ones are that make it; a window as
        the last readings are; one that has retired, or is to be grown, is unknown.

        Args:
            bits: What the world's own sensors read.
            own: ``(n,)``, which of these readings are known; if None, all.
            action: The one taken in the step that has just ended; -1: none was.
            state: ``(2N,)``, recorded before that step; None at the beginning.
            begins: It follows no step: no action or contextual sensor is on.
        """
        observation = np.zeros(self._count, np.bool_)
        known = np.ones(self._count, np.bool_)
        observation[self._own] = bits
        if own is not None:
            known[self._own] = own
        step = None if action < 0 or begins else state
        if step is not None and self._felt.start < self._felt.stop:
            observation[self._felt.start + action] = True
        before, self._known = self._known, own
        if self._windows is not None:
            read = self._windows.observe(observation[self._own], own, begins)
            observation[self._contextual], known[self._contextual] = read
        else:
            taken = self._contexts.action == action
            if step is not None:
                holds = self._contexts.hold(step)
                np.logical_and(taken, holds, out=observation[self._contextual])
            if step is not None and before is not None:
                told = self._contexts.told(step, before)
                known[self._contextual] = told | ~taken
            known[self._contextual] &= self._contexts.in_use
            if carried := list(self._body.carries):
                last = np.zeros(2 * self._count, np.bool_) if step is None else step
                now = self._body.carried(last, selection(observation, known))
                on, off = now.reshape(-1, 2)[carried].T
                observation[carried], known[carried] = on, on | off
        return observation, None if known.all() else known
