"""How often trying something new brought what was not expected."""

from typing import Final

import numpy as np

from neurosnap.poc.learning.archive import Arrays, entry

BEGINNING: Final = -1
"""Stands for the beginning of an episode where an action may."""


class Surprises:
    """Counts trials and surprises, of each action and of beginning an episode.

    A trial of an action is where all that it leads to seemed to be known, and it had
    never been taken; a surprise, that something else came. An episode that begins is a
    trial, and a surprise where nothing was ever done.

    Args:
        actions: How many there are.
    """

    def __init__(self, actions: int) -> None:
        self._counts = np.zeros((actions + 1, 2), np.int64)  # trials, surprises

    def count(self, action: int, surprise: bool) -> None:
        """Take in a trial; an action's or `BEGINNING`."""
        self._counts[action] += (1, surprise)

    def share(self, action: int) -> float:
        """Return the share of trials to expect a surprise of, in (0, 1).

        It is Laplace's rule of succession: 1/2 before there was any trial.
        """
        trials, surprises = self._counts[action]
        return float((surprises + 1) / (trials + 2))

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        return {"surprises": self._counts}

    def restore(self, arrays: Arrays) -> None:
        """Be as the arrays say.

        Raises:
            ValueError: They make no sense.
        """
        shape = self._counts.shape
        self._counts = entry(arrays, "surprises", shape, np.int64).copy()
