"""Which contexts hold in a state, and of which one can tell."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body


class Contexts:
    """Tells which contexts hold in a state, for all contextual sensors at once.

    Args:
        body: Which sensors there are.

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
        single: NDArray[np.bool_] = state[self._single]
        if not self._starts.size:
            return np.concatenate((single, self._free)) if self._free.size else single
        grown = np.logical_and.reduceat(state[self._grown], self._starts)
        return np.concatenate((single, grown, self._free)) & self.in_use

    def told(
        self, state: NDArray[np.bool_], known: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return of which one can tell whether they hold: ``(contexts,)``.

        A literal is told where it or its complement is in the state, or its reading was
        known. A context is told where all its literals are, or one that is not in the
        state.

        Args:
            state: ``(2N,)``.
            known: ``(n,)``, which readings of the world's own sensors were known then.
        """
        literal = self._single
        single: NDArray[np.bool_] = (
            known[literal >> 1] | state[literal] | state[literal ^ 1]
        )
        if not self._starts.size:
            return np.concatenate((single, self._free)) if self._free.size else single
        literal = self._grown
        read = np.zeros(len(state) // 2, np.bool_)
        read[: len(known)] = known
        told = read[literal >> 1] | state[literal] | state[literal ^ 1]
        all_told = np.logical_and.reduceat(told, self._starts)
        one_off = np.logical_or.reduceat(told & ~state[literal], self._starts)
        return np.concatenate((single, all_told | one_off, self._free)) & self.in_use
