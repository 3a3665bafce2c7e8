"""The observation of an agent: its world's sensors, its actions, actions in context.

`Contexts` says which contexts hold in a state, and of which one can tell.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.sensorium import complement


class Contexts:
    """Tells which contexts hold in a state, for all contextual sensors at once.

    Attributes:
        action: ``(contexts,)``: the action of each; of one not yet grown, 0.
        in_use: ``(contexts,)``: whether it is read at all.
    """

    def __init__(self, body: Body) -> None:
        free = body.room - len(body.grown)
        actions = [action for action, _ in (*body.context, *body.grown)]
        self.action = np.array([*actions, *(0 for _ in range(free))], np.intp)
        self._free = np.zeros(free, np.bool_)
        self._single = np.array([literal for _, literal in body.context], np.intp)
        self._grown = np.array([a for _, many in body.grown for a in many], np.intp)
        ends = np.cumsum([len(many) for _, many in body.grown])
        self._starts = np.concatenate(([0], ends))[: len(body.grown)].astype(np.intp)
        self.in_use = np.ones(len(self.action), np.bool_)
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


class Senses:
    """Makes an agent's observation from its world's readings and its last action."""

    def __init__(self, body: Body) -> None:
        own, felt = len(body.own), len(body.actions) * body.senses_actions
        self._own = slice(0, own)
        self._felt = slice(own, own + felt)
        self._contexts = Contexts(body)
        self._contextual = slice(own + felt, own + felt + len(self._contexts.action))
        self._count = self._contextual.stop
        self.looks_back = bool(felt or body.context)
        """Whether an observation depends on the step before it."""

    def observe(
        self,
        bits: NDArray[np.bool_],
        action: int = -1,
        state: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:
        """Return the whole observation: ``(N,)``.

        Args:
            bits: What the world's own sensors read.
            action: The one taken in the step that has just ended; -1 at the beginning,
                when none was and no action or contextual sensor is on.
            state: ``(2N,)``, recorded before that step; None at the beginning.
        """
        observation = np.zeros(self._count, np.bool_)
        observation[self._own] = bits
        if action >= 0 and state is not None:
            if self._felt.start < self._felt.stop:
                observation[self._felt.start + action] = True
            np.logical_and(
                self._contexts.action == action,
                self._contexts.hold(state),
                out=observation[self._contextual],
            )
        return observation

    def known(
        self,
        own: NDArray[np.bool_] | None,
        action: int = -1,
        state: NDArray[np.bool_] | None = None,
        before: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_] | None:
        """Return which readings are known: ``(N,)``; None if all are.

        Actions always are. ``α∧a`` is known where ``α`` was not taken, for then it is
        off; where a literal of the sensor was in the state before, even if only because
        something implied it; and where the sensor's reading was known then. (If that
        was contradicted, neither literal was in the state, and ``α∧a`` is off.) One of
        several literals is on or off as the single ones are that make it; one that has
        retired, or is still to be grown, is unknown.

        Args:
            own: ``(n,)``, which readings of the world's own sensors are known; if None,
                all.
            action: As in `observe`.
            state: As in `observe`.
            before: As `own`, when `state` was recorded.
        """
        known = np.ones(self._count, np.bool_)
        if own is not None:
            known[self._own] = own
        if action >= 0 and state is not None and before is not None:
            told = self._contexts.told(state, before)
            known[self._contextual] = told | (self._contexts.action != action)
        if not self._contexts.in_use.all():
            known[self._contextual] &= self._contexts.in_use
        return None if known.all() else known
