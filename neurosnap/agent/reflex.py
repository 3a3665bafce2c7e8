"""Greedy planning with a memory of where nothing led nearer to the target.

Such a place seems farther away from then on, by as much as the best step from there
makes it. So a greedy agent leaves what would hold it for ever. It costs no wave more
than to plan greedily, and is what an agent does that imagines no way to its target.

References:
    Not the paper's, which calls it a failure of greedy planning to be overcome. The
    rule is LRTA* (Korf 1990), with open subgoals as the distance to begin with.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.planner import Planner


class Reflex(Planner):
    """Decides by greedy reactive planning, and gets stuck nowhere for ever.

    Args:
        body: As for `Planner`.
        target: As for `Planner`.
        seed: Draws among equals.
        experience: Remembers which places were raised.

    Raises:
        InvalidValueError: As for `Planner`.
    """

    def __init__(
        self, body: Body, target: Iterable[str | int], seed: int, experience: Experience
    ) -> None:
        self._experience = experience
        super().__init__(body, target, seed, explore=0.0)

    def _score(
        self,
        met: NDArray[np.int_],
        bound: NDArray[np.bool_],
        held: int,
        state: NDArray[np.bool_],
    ) -> NDArray[np.int_]:
        """Return how good each action is, and raise the place if none leads nearer."""
        experience = self._experience
        keys = [experience.key(after & experience.looked_at) for after in bound]
        raised = [experience.raised.get(key, 0) for key in keys]
        score: NDArray[np.int_] = met - np.array(raised)
        here = experience.key(state & experience.looked_at)
        experience.lift(here, held + 1 - int(score.max()))
        return score
