"""An agent in its environment: step after step, episode after episode."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.agent.environment import Continuing, describe
from neurosnap.errors import InvalidValueError
from neurosnap.wire import Decision


@dataclass(frozen=True, slots=True)
class Outing:
    """What an agent did in an environment, and what came of it."""

    steps: int
    """Actions taken."""
    episodes: int
    """Episodes begun."""
    reward: float
    """The rewards of all steps, added up."""
    reached: bool
    """Whether the target was sensed, where there is one."""


class Acting(Protocol):
    """Whoever observes and decides."""

    def act(self, bits: ArrayLike, begins: bool = False) -> Decision:
        """Observe, learn, and decide."""
        ...

    def set_down(self) -> None:
        """Take in that it was moved by somebody."""
        ...


def walk(
    agent: Acting,
    env: gymnasium.Env[Any, Any],
    steps: int,
    *,
    seed: int | None = None,
    choices: Sequence[int] | None = None,
    until: Callable[[NDArray[np.bool_]], bool] | None = None,
) -> Outing:
    """Let an agent act until a number of steps is done, or what is wanted is sensed.

    The environment is reset first, and whenever an episode is over. What the last step
    led to is observed, too.

    Args:
        agent: Acts.
        env: Its observations are ``MultiBinary``; it is not closed.
        steps: How many actions to take at most.
        seed: For the first reset.
        choices: Which of the environment's actions the agent's stand for; None: all.
        until: Is told what the environment's sensors read, ``(n,)``.

    Raises:
        InvalidValueError: `steps` is negative, or the environment is not fit for an
            agent.
    """
    if steps < 0:
        raise InvalidValueError("steps", "must be 0 or more", steps)
    said = describe(type(env.unwrapped).__name__, env)
    going_on = env if isinstance(env, Continuing) else Continuing(env)
    bits, info = going_on.reset(seed=seed)
    agent.set_down()
    taken, episodes, total, reached = 0, 1, 0.0, False
    while True:
        reached = until is not None and until(np.asarray(bits, np.bool_))
        decision = agent.act(bits, info["begins"])
        if reached or taken == steps:
            return Outing(taken, episodes, total, reached)
        action = decision.action if choices is None else choices[decision.action]
        bits, reward, _, _, info = going_on.step(said.step(action))
        taken, total = taken + 1, total + float(reward)
        episodes += info["begins"]
        if info["cut"]:
            agent.set_down()
