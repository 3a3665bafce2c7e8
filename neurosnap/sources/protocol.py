"""The protocol of a source of observations."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Source(Protocol):
    """A sequence of observations, which actions may influence."""

    sensors: tuple[str, ...]
    """The sensors' names, in the order of the observations."""
    orders: tuple[int, ...]
    """For each, how many steps it looks back; 0: a state sensor."""
    actions: tuple[str, ...]
    """The names of the atomic actions; none: it takes none."""
    exclusive: bool
    """Exactly one of them is taken at each step."""
    discrete: bool
    """It shows the states of a world in which these are discrete."""
    length: int | None
    """Observations it has in all, the first included; None: no end is known."""
    begins: bool
    """The last observation begins a trajectory: it follows no action."""
    cut: bool
    """It does, and the trajectory before, if there was one, had not come to its own
    end: a limit on time cut it off, or nobody listened for a while."""
    paused: bool
    """Nothing is to be learned from the last observation: somebody said so."""
    known: NDArray[np.bool_] | None
    """``(N,)``, which readings of the last observation are known, one at least; what
    the others are means nothing. None: all are known."""
    live: bool
    """It observes what goes on by itself: it takes its time, and never starts over. In
    a run that is resumed its first call is a `step`."""

    def first(self) -> NDArray[np.bool_] | None:
        """Start, or start over, and return the first observation: ``(N,)``.

        None: it is over already. A live source may make its caller wait.
        """

    def step(self, action: int) -> NDArray[np.bool_] | None:
        """Return the observation that follows a choice; None: it is over, for good.

        Choices count from 0: where actions exclude each other, a choice is an action;
        otherwise its bits say which are taken. A live source may make its caller wait.
        """

    def close(self) -> None:
        """Give up what it holds; may be called twice.

        With a live source it may be called from any thread: whoever waits in `first` or
        `step` gets None.
        """
