"""The random policy ("walker"): uniform actions, and one planning wave per tick.

What it asks the network, and what it does, is drawn without regard to the answer.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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

    def ask(self, tick: int, state: NDArray[np.bool_]) -> list[tuple[int, ...]]:
        """Return the signals of the planning waves to send before the decision.

        A walker asks for what one sensation of the state implies, drawn anew each tick:
        a wave that has to travel, where a state wave finds every cell fired already.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.

        Returns:
            One signal of one literal; none where the state is empty.
        """
        on = np.flatnonzero(state)
        if len(on) == 0:
            return []
        # A number of its own: what is asked must not change what is done.
        return [(pick(on, self._random.at(tick)[1]),)]

    def decide(
        self,
        tick: int,
        state: NDArray[np.bool_],
        answers: Sequence[NDArray[np.bool_]],
    ) -> tuple[int, str]:
        """Return the action for `tick`, -1 for none, and the reason for it.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``; does not matter.
            answers: Do not matter either.
        """
        del state, answers
        if not self._choices.size:
            return -1, "the source takes no actions"
        return pick(self._choices, self._random.at(tick)[0]), "random walk"
