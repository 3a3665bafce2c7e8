"""The actions of an agent, and the consequences that are certain by definition.

A generalised action is a complete *-selection of the atomic actions. Where they
exclude each other, as they do unless said otherwise, only the pure ones can be done: a
pure action is asked about by itself, and the others' complements follow once the agent
has learned that they exclude each other.

References:
    [GK] "Defining Actions"; "Algorithm: Computing the consequences of an action". The
    paper propagates over the graph loaded with the state, which keeps what is sensed of
    the *last* step (`better`, the last action); what an action guarantees is the
    forward closure alone.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.contexts import Contexts
from neurosnap.errors import InvalidValueError


class Actions:
    """The choices of a body, and what to ask in order to know what they lead to.

    Args:
        body: With at least one action, each of them a sensor.

    Raises:
        InvalidValueError: The body cannot act, or does not sense that it does.
    """

    def __init__(self, body: Body) -> None:
        if not body.actions or not body.senses_actions:
            rule = "must have actions that are sensors"
            raise InvalidValueError("agent", rule, body.actions)
        self._exclusive = body.exclusive
        self._contexts = Contexts(body)
        own = len(body.own)
        self._first = own + len(body.actions)
        self._selections: list[tuple[int, ...]] = []
        # For each choice, which contextual sensors it can switch on.
        self._taken: list[NDArray[np.bool_]] = []
        for taken in body.choices:
            on = taken.nonzero()[0] if body.exclusive else range(len(taken))
            self._selections.append(
                tuple(2 * (own + int(k)) + (not taken[k]) for k in on)
            )
            self._taken.append(taken[self._contexts.action])

    def signals(self, state: NDArray[np.bool_]) -> list[tuple[int, ...]]:
        """Return for each choice what making it here would switch on.

        Args:
            state: ``(2N,)``, the coherent state.

        Returns:
            ``A ∪ {α∧c : α in A, c in the state}`` for each choice ``A``, with ``c`` one
            literal, or the several of a grown sensor.
        """
        holds = self._contexts.hold(state)
        return [self._signal(choice, holds) for choice in range(len(self._selections))]

    def signal(self, choice: int, state: NDArray[np.bool_]) -> tuple[int, ...]:
        """Return what one choice would switch on here, as in `signals`."""
        return self._signal(choice, self._contexts.hold(state))

    def _signal(self, choice: int, holds: NDArray[np.bool_]) -> tuple[int, ...]:
        contexts = np.flatnonzero(holds & self._taken[choice])
        return (*self._selections[choice], *(2 * (self._first + contexts)).tolist())

    def admissible(self, closures: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """Return which choices the agent believes it can make: ``(choices,)``.

        A choice that implies the complement of an action in it is believed to be
        impossible: it is no vertex of the dual of the actions ([GK] "Invoking Actions
        Synchronously"). If all are, the belief is wrong, for one is made at each step.
        A pure action can always be taken ([GK] "Defining Actions"): a belief to the
        contrary would never be tried, and so never given up.

        Args:
            closures: For each choice, the closure of its signal: ``(2N,)``.
        """
        if self._exclusive:
            return np.ones(len(closures), np.bool_)
        possible = np.array(
            [
                not any(up[literal ^ 1] for literal in selection)
                for selection, up in zip(self._selections, closures, strict=True)
            ]
        )
        return possible if possible.any() else ~possible


def guaranteed(closures: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Return what each action guarantees ([GK] consequences of an action).

    Args:
        closures: For each action, ``↑signal``: ``(2N,)``.

    Returns:
        ``(actions, 2N)``: on iff the literal is in the closure and its complement is
        not. Sensations that were never met are equivalent for an empirical snapshot:
        before anything was learned of them, an action may seem to guarantee them.
    """
    above = np.stack(closures)
    pairs = above.reshape(len(closures), -1, 2)
    bound: NDArray[np.bool_] = pairs & ~pairs[:, :, ::-1]
    return bound.reshape(above.shape)
