"""The walker: a random action at every tick, and a look at where one sensation leads.

What it asks the network, and what it does, is drawn without regard to the answer. Each
choice is drawn from a generator keyed by (seed, tick), so a run is a function of
its seed and its observations, whatever order the messages came in.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


class Walker:
    """Decides at random.

    Args:
        actions: How many actions there are; 0 for a source that takes none.
        seed: Draws the actions.
    """

    def __init__(self, actions: int, seed: int) -> None:
        self._actions = actions
        self._seed = seed

    def _generator(self, tick: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, tick])

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
        return [(int(self._generator(tick).choice(on)),)]

    def decide(
        self,
        tick: int,
        state: NDArray[np.bool_],
        answers: Sequence[NDArray[np.bool_]],
    ) -> tuple[int, str]:
        """Return the action for `tick`, -1 for none, and the reason for it.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.
            answers: For each signal asked for, ``(2N,)``: all it implies.
        """
        if self._actions == 0:
            return -1, "the source takes no actions"
        # A stream of its own: what is asked must not change what is done.
        generator = np.random.default_rng([self._seed, tick, 1])
        return int(generator.integers(self._actions)), "random walk"
