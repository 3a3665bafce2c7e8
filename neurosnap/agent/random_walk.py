"""The random policy ("walker"): uniform actions, and one planning wave per tick.

What it asks the network, and what it does, is drawn without regard to the answer.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.policy import Deliberation
from neurosnap.agent.random_numbers import RandomNumbers, pick


class Walker:
    """Decides at random.

    Args:
        choices: How many choices there are; 0 for a source that takes no actions.
        seed: Draws the actions.
    """

    def __init__(self, choices: int, seed: int) -> None:
        self._choices = np.arange(choices)
        self._random = RandomNumbers(seed)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Ask what one sensation of the state implies, and act at random all the same.

        The sensation is drawn anew each tick: a wave that has to travel, where a state
        wave finds every cell fired already. Where the state is empty nothing is asked.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.
        """
        on, draws = np.flatnonzero(state), self._random.at(tick)
        if len(on):
            # A number of its own: what is asked must not change what is done.
            yield [(pick(on, draws[1]),)]
        if not self._choices.size:
            return -1, "the source takes no actions"
        return pick(self._choices, draws[0]), "random walk"

    def grow(self, body: Body) -> None:
        """Go on as before: what it does does not depend on its sensors."""
