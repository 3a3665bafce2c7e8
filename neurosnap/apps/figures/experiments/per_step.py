"""Base class of table entries with one number per step."""

import msgspec
import numpy as np
from numpy.typing import DTypeLike


class PerStepEntry(msgspec.Struct, frozen=True, kw_only=True):
    """An entry of the table of results that holds a number per step."""

    runs: int
    """How many rows it has, each from nothing."""
    steps: int
    """Observations in each run."""
    seed: int
    """Draws what is observed."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a row: ``(steps,)``."""
        return (self.steps,)

    @property
    def dtype(self) -> DTypeLike:
        """The type of a row."""
        return np.uint16
