"""How long sensors go on reading the same: what thresholds that choose themselves need.

That a door is open with a lamp on for an hour is one occasion, and not as many as ticks
were counted.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.update_kernels_auto import note_readings

_NOTHING = 2


class Persistence:
    """How often each literal was read, and how often it ended.

    Unknown readings in between are left out. A sensor that is grown has none before it
    is read, whatever its history.

    Args:
        sensors: How many there are.

    Attributes:
        spells: ``(2, 2N)``: at how many ticks each literal was read, and after how many
            of them its complement was read next.
        turns: ``(N,)``: whether it is a sensor's turn to be tested at this tick.
    """

    def __init__(self, sensors: int) -> None:
        self.spells = np.zeros((2, 2 * sensors), np.uint32)
        self.turns = np.zeros(sensors, np.uint8)
        self._last = np.full(sensors, _NOTHING, np.uint8)

    def note(self, bits: NDArray[np.uint8], known: NDArray[np.uint8]) -> None:
        """Take in an observation. O(N) time.

        Args:
            bits: ``(N,)``, 0 or 1.
            known: ``(N,)``, 0 or 1.
        """
        note_readings(bits, known, self._last, self.spells, self.turns)

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        return {"spells": self.spells, "last": self._last}

    def restore(self, arrays: Arrays) -> None:
        """Be as the arrays say; it is nobody's turn.

        Raises:
            ValueError: They make no sense.
        """
        self.spells[:] = entry(arrays, "spells", self.spells.shape, np.uint32)
        self._last[:] = entry(arrays, "last", self._last.shape, np.uint8)
        if (self.spells[1] > self.spells[0]).any() or (self._last > _NOTHING).any():
            raise ValueError("spells, last: must be what readings make")
