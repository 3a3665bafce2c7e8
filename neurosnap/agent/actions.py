"""The actions of an agent, and the implications about them that hold by definition.

References:
    [GK] "Defining Actions"; "Algorithm: Computing the consequences of an action". The
    paper propagates over the graph loaded with the state, which keeps what is sensed of
    the *last* step (`better`, the last action); what an action guarantees is the
    forward closure alone. Its generalised actions, several atomic ones at a step, are
    not here: of the atomic ones exactly one is taken.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent_observation import Contexts
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError


class Actions(Contexts):
    """The actions of a body, and the literals from which a wave predicts each.

    Args:
        body: With at least one action, each of them a sensor.

    Raises:
        InvalidValueError: The body cannot act, or does not sense that it does.
    """

    def __init__(self, body: Body) -> None:
        if not body.actions or not body.senses_actions:
            rule = "must have actions that are sensors"
            raise InvalidValueError("agent", rule, body.actions)
        super().__init__(body)
        self._actions = range(len(body.actions))
        self._own = len(body.own)
        self._first = self._own + len(body.actions)

    def signals(self, state: NDArray[np.bool_]) -> list[tuple[int, ...]]:
        """Return what taking each action in a coherent state, ``(2N,)``, switches on.

        Returns:
            ``α`` and every ``α∧c`` with ``c`` in the state, for each action ``α``;
            ``c`` is one literal, or the several of a grown sensor.
        """
        holds = self.hold(state)
        return [self.signal(action, holds) for action in self._actions]

    def signal(self, action: int, holds: NDArray[np.bool_]) -> tuple[int, ...]:
        """Return what one action would switch on where these contexts hold."""
        contexts = np.flatnonzero(holds & (self.action == action))
        on = 2 * (self._first + contexts)
        return (2 * (self._own + action), *on.tolist())


def guaranteed(closures: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Return the literals that each action guarantees ([GK] consequences of an action).

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
