"""The protocol of a source of observations."""

from typing import Protocol, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire

Argument: TypeAlias = bool | int | float | str
"""What may be given to a source by name."""


class Observed(msgspec.Struct, frozen=True, eq=False):
    """One observation: what the sensors read, and whether it follows an action.

    It holds for good: no later step changes it, and any thread may read it.
    """

    bits: NDArray[np.bool_]
    """``(N,)``, what the sensors read."""
    known: NDArray[np.bool_] | None = None
    """``(N,)``, which readings are known, one at least; what the others are means
    nothing. None if all are known."""
    begins: bool = False
    """It begins a trajectory: it follows no action."""
    cut: bool = False
    """It begins one, and the trajectory before, if there was one, had not come to its
    own end: a limit on time cut it off, or the source was not listened to for a
    while."""
    received: wire.Received = wire.Received()
    """What a live source has received so far, this tick included."""
    outages: tuple[wire.Outage, ...] = ()
    """When it could not listen since the last tick."""
    at: float = 0
    """When it was, as the data say, in seconds since 1970; 0: now."""
    said: bytes = b""
    """The numbers behind it; see `wire.Observation`."""
    due: float = 0
    """As in `wire.Observation`."""
    waiting: int = 0
    """Likewise."""


class Source(Protocol):
    """A sequence of observations, which actions may influence.

    One thread at a time calls `first` and `step`. Only `close` of a live source may be
    called meanwhile, by any thread.
    """

    sensors: tuple[str, ...]
    """The sensors' names, in the order of the observations."""
    orders: tuple[int, ...]
    """For each, how many steps it looks back; 0: a state sensor."""
    actions: tuple[str, ...]
    """The names of the actions, of which one is taken at each step; none: it takes
    none."""
    discrete: bool
    """It shows the states of a world in which these are discrete."""
    length: int | None
    """Observations it has in all, the first included; None if no end is known."""
    live: bool
    """It observes what goes on by itself: it takes its time, and never starts over. In
    a run that is resumed its first call is a `step`."""

    def first(self) -> Observed | None:
        """Start, or start over, and return the first observation.

        None if it is over already. A live source may make its caller wait.
        """

    def step(self, action: int) -> Observed | None:
        """Return the observation that follows a choice; None if it is over, for good.

        Choices count from 0. A live source may make its caller wait.
        """

    def close(self) -> None:
        """Give up what it holds; may be called twice.

        With a live source it may be called from any thread: a caller that waits in
        `first` or `step` gets None.
        """
