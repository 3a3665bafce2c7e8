"""The interface of a policy, and the kinds of policies.

A policy is a pure function of the seed, the tick, the state and the answers to what it
asked; it does not know who answers. In process it is the propagation over the graph,
in a swarm it is waves: the decisions are the same.
"""

from collections.abc import Sequence
from typing import Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

AgentKind: TypeAlias = Literal["walker", "excited", "planner"]

EXPLORE = 0.2
"""The share of random actions, unless another is given.

Enough for an agent that forgets to find back to a target it has lost, and little enough
to stay near one it has found."""


class Policy(Protocol):
    """What decides once the state is known."""

    def ask(self, tick: int, state: NDArray[np.bool_]) -> list[tuple[int, ...]]:
        """Return the signals whose closures it wants to know first."""
        ...

    def decide(
        self,
        tick: int,
        state: NDArray[np.bool_],
        answers: Sequence[NDArray[np.bool_]],
    ) -> tuple[int, str]:
        """Return the action, -1 for none, and the reason.

        `answers` holds ``↑signal`` for each signal asked for, ``(2N,)`` each.
        """
        ...


def checked_share(explore: float) -> float:
    """Return a share of random actions.

    Raises:
        InvalidValueError: It is not in [0, 1].
    """
    if not 0 <= explore <= 1:
        raise InvalidValueError("explore", "must be in [0, 1]", explore)
    return float(explore)
