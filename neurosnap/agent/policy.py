"""The interface of a policy, the kinds of policies, and the default.

A policy does not know who answers what it asks. In process it is the propagation over
the graph, in a swarm it is waves: the decisions are the same. The paper's policies are
pure functions of the seed, the tick, the state and the answers; what another one keeps
from tick to tick is in its `Experience`, so that it can be recorded.
"""

from collections.abc import Generator, Sequence
from typing import Final, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.automatic_threshold import AUTO

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

Signal: TypeAlias = tuple[int, ...]
"""The literals a planning wave starts from, each once."""
Closures: TypeAlias = Sequence[NDArray[np.bool_]]
"""``↑signal`` for each signal asked for, ``(2N,)`` each."""
Deliberation: TypeAlias = Generator[list[Signal], Closures, tuple[int, str]]
"""Asks for the closures of signals, round after round, and is sent them; returns the
action, -1 for none, and the reason."""


class Policy(Protocol):
    """What decides once the state is known."""

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Decide what to do; each round asks for one closure at least.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.
        """
        ...

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        ...


WIDTH = 4
"""Numbers a tick: what one turn of the Philox counter gives."""

_BLOCK = 1024  # ticks drawn at once: making a generator costs as much as a tick


class RandomNumbers:
    """Numbers in [0, 1), `WIDTH` for every tick, from a counter-based generator.

    Numbers that came from one stream would depend on how many were drawn before, and so
    on the order in which messages arrived. These depend on the seed and the tick alone.

    Args:
        seed: The generator's key, from 0 up.

    Raises:
        InvalidValueError: The seed is out of range.

    Examples:
        >>> RandomNumbers(seed=7).at(3).shape
        (4,)
    """

    def __init__(self, seed: int) -> None:
        if not 0 <= seed < 2**128:
            raise InvalidValueError("seed", "must be in [0, 2**128)", seed)
        self._seed = seed
        self._number = -1
        self._block: NDArray[np.float64] = np.empty((0, WIDTH))

    def at(self, tick: int) -> NDArray[np.float64]:
        """Return the numbers of `tick`, from 0 up: ``(WIDTH,)``, read-only."""
        number, place = divmod(tick, _BLOCK)
        if number != self._number:
            generator = np.random.Philox(key=self._seed)
            generator.advance(number * _BLOCK)
            raw = generator.random_raw(WIDTH * _BLOCK)
            # The upper 53 bits, as numpy makes its doubles.
            numbers = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
            self._block = numbers.reshape(_BLOCK, WIDTH)
            self._block.flags.writeable = False
            self._number = number
        drawn: NDArray[np.float64] = self._block[place]
        return drawn


def pick(options: NDArray[np.int64], draw: float) -> int:
    """Return one of `options`, each as likely, by a number in [0, 1)."""
    return int(options[int(draw * len(options))])


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
    """Return a share of random actions.

    Raises:
        InvalidValueError: It is not in [0, 1].
    """
    if not 0 <= explore <= 1:
        raise InvalidValueError("explore", "must be in [0, 1]", explore)
    return float(explore)
