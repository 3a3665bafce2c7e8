"""The interface of a policy, and default values for exploring and for learning.

A policy does not know who answers what it asks. In process it is the propagation over
the graph, in a swarm it is waves: the decisions are the same. The paper's policies are
pure functions of the seed, the tick, the state and the answers; what another one keeps
from tick to tick is in its `Experience`, so that it can be recorded.
"""

from collections.abc import Generator, Iterable, Mapping, Sequence
from typing import Any, Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.automatic_threshold import AUTO
from neurosnap.poc.learning.history_questions import Question

AgentKind: TypeAlias = Literal["walker", "excited", "planner"]
EXPLORE = 0.2
"""The share of random actions, unless another is given.

Enough for an agent that forgets to find back to a target it has lost, and little enough
to stay near one it has found."""
TRIES = 0.1
"""The share of random actions where exploration is planned, and nothing else is wanted.

They test what seems known: plans go where an outcome is unknown, and nowhere else."""
Exploration: TypeAlias = float | Literal["planned"]
"""A share of random actions; or to go where the outcome of an action is unknown."""
Aim: TypeAlias = Iterable[str | int] | Mapping[str | int, float]
"""Literals by name or number: to be achieved jointly, or with what each is worth."""
Signal: TypeAlias = tuple[int, ...]
"""The literals a planning wave starts from, each once."""
Closures: TypeAlias = Sequence[NDArray[np.bool_]]
"""``↑signal`` for each signal asked for, ``(2N,)`` each."""
Deliberation: TypeAlias = Generator[list[Signal] | Question, Any, tuple[int, str]]
"""Asks for the closures of signals, or for past readings, round after round, and is
sent `Closures` or an `Answer`; returns the action, -1 for none, and the reason."""


class Policy(Protocol):
    """Chooses the action of a tick once the state is known."""

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Decide what to do at a tick, by its coherent state, ``(2N,)``.

        Each round asks for one closure at least.
        """

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""


EXACT: Final = 1 / 100_000
"""A threshold that allows for no exception in the first hundred thousand ticks."""


def default_threshold(body: Body, discrete: bool) -> float | Literal["auto"]:
    """Return the threshold of an empirical snapshot for which none is given.

    In a world of discrete states an action leads to the same wherever the same is
    sensed, or the sensors do not tell: one exception disproves a belief. What tolerates
    exceptions takes what is rare there for noise: a goal, or what is done beside a
    cliff. Where sensors are bins of what is continuous, each action has exceptions at
    the edges of the bins, and a memory that allows for none believes nothing of use.

    Args:
        body: What is sensed and done.
        discrete: Whether its world shows discrete states.

    Returns:
        `EXACT` for an agent that senses its actions in context, if the world is
        discrete or it has room for sensors to be grown; otherwise ``"auto"``: each pair
        of sensors chooses its own.
    """
    return EXACT if body.context and (discrete or body.room) else AUTO


def checked_share(explore: float) -> float:
    """Return a share of random actions; InvalidValueError if it is not in [0, 1]."""
    if not 0 <= explore <= 1:
        raise InvalidValueError("explore", "must be in [0, 1]", explore)
    return float(explore)
