"""The learning threshold that fits what an agent is and where it acts."""

from typing import Final, Literal

from neurosnap.agent.body import Body
from neurosnap.poc.learning.thresholds import AUTO

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
