"""What an agent has met so far, as far as imagining needs to know it."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body


class Experience:
    """The sensations an agent has met, and the places where its episodes ended.

    Args:
        body: What is sensed and done.

    Attributes:
        met: ``(2N,)``: the literals that were in a state.
        ends: Places, as bytes of what `Body.place` returns, at which an episode ended
            the last time: what is done there is not seen.
        hopeless: ``(actions, 2n)``: which results of an action, literals of the world's
            own, seem to be left to chance.
    """

    def __init__(self, body: Body) -> None:
        self.met = np.zeros(2 * len(body.sensors), np.bool_)
        self.ends: set[bytes] = set()
        self.hopeless = np.zeros((len(body.actions), 2 * len(body.own)), np.bool_)

    def leave(self, place: NDArray[np.bool_], ends: bool) -> None:
        """Take in what came after a place: another episode, or the next step.

        Args:
            place: ``(2n,)``.
            ends: Whether it was another episode.
        """
        if ends:
            self.ends.add(place.tobytes())
        else:
            self.ends.discard(place.tobytes())

    def enter(self, state: NDArray[np.bool_]) -> None:
        """Take in a state: ``(2N,)``."""
        self.met |= state
