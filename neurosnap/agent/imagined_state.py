"""A state that is imagined, and how it is reached."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class ImaginedState:
    """What an action is imagined to lead to, or the state things are in now."""

    place: NDArray[np.bool_]
    """``(2N,)``: the literals that hold, as far as they tell places apart."""
    before: "ImaginedState | None" = None
    """Where the action was taken; None: it is where things are now."""
    action: int = -1
    """The one that led to it."""
    steps: int = 0
    """How many actions led to it."""
    by_chance: bool = False
    """Whether it, or one on the way, is left to chance in part."""

    def way(self) -> list["ImaginedState"]:
        """Return the states from the first, which no action led to, to this one."""
        states: list[ImaginedState] = []
        state: ImaginedState | None = self
        while state is not None:
            states.append(state)
            state = state.before
        return states[::-1]
