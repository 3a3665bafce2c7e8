"""What an agent has met so far, as far as imagining needs to know it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.poc.learning.archive import Arrays, entry, rows_in

_MOST = 1 << 16  # actions that are known to have been taken at a place


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Actions in a row, and where each is to be taken."""

    actions: tuple[int, ...]
    """One or more."""
    places: NDArray[np.bool_]
    """``(actions, 2n)``: what is expected to be sensed before each."""
    why: str
    """How its reason begins."""

    def goes_on(self, place: NDArray[np.bool_]) -> bool:
        """Return whether what is sensed, ``(2n,)``, is all that was expected."""
        return not (self.places[0] & ~place).any()

    def step(self) -> tuple[int, "Plan | None"]:
        """Return the next action, and the plan behind it."""
        action, *rest = self.actions
        after = Plan(tuple(rest), self.places[1:], self.why) if rest else None
        return action, after


class Experience:
    """The sensations an agent has met, and the places where its episodes ended.

    Args:
        body: What is sensed and done.

    Attributes:
        met: ``(2N,)``: the literals that were in a state.
        ends: Places, as bytes of what `Body.place` returns, at which an episode ended
            the last time: what is done there is not seen.
        tried: Places, as `key` tells them apart, each with an action that was taken
            there: the latest, in the order in which they were first.
        hopeless: ``(actions, 2n)``: which results of an action, literals of the world's
            own, seem to be left to chance.
        plan: What is under way; None: nothing is.
    """

    def __init__(self, body: Body) -> None:
        self.met = np.zeros(2 * len(body.sensors), np.bool_)
        self.ends: set[bytes] = set()
        self.tried: dict[tuple[bytes, int], None] = {}
        self.hopeless = np.zeros((len(body.actions), 2 * len(body.own)), np.bool_)
        self._foreseen = np.ones(2 * len(body.own), np.bool_)
        self.plan: Plan | None = None

    def key(self, place: NDArray[np.bool_]) -> bytes:
        """Return what tells a place from another one.

        It is what is said there of the sensors that some action has a foreseeable
        effect on. Any other reading, a coin's say, is never part of an imagined place.

        Args:
            place: ``(2n,)``, as `Body.place` returns it.
        """
        return (place & self._foreseen).tobytes()

    def is_end(self, place: NDArray[np.bool_], action: int) -> bool:
        """Return whether an episode ended at an imagined place. O(n ends) time.

        Args:
            place: ``(2n,)``. Of some sensors it may say nothing: if that is left to
                chance, the rest tells; else it is not known.
            action: What is imagined to lead there.
        """
        said = place.reshape(-1, 2).any(axis=1).repeat(2)
        if not self.ends or not (said | self.hopeless[action]).all():
            return place.tobytes() in self.ends
        ends = np.frombuffer(b"".join(self.ends), np.bool_).reshape(-1, place.size)
        return bool(((ends & said) == place).all(axis=1).any())

    def give_up(self, hopeless: NDArray[np.bool_]) -> None:
        """Take in which results of actions, ``(actions, 2n)``, are left to chance."""
        self.hopeless = hopeless
        chance = hopeless.all(axis=0).reshape(-1, 2).all(axis=1)
        foreseen = ~np.repeat(chance, 2)
        if (foreseen != self._foreseen).any():
            self._foreseen = foreseen
            self.tried = {
                (self.key(np.frombuffer(old, np.bool_)), action): None
                for old, action in self.tried
            }

    def leave(self, place: NDArray[np.bool_], ends: bool, action: int = -1) -> None:
        """Take in what came after a place: another episode, or the next step.

        Args:
            place: ``(2n,)``.
            ends: Whether it was another episode.
            action: The one taken there; -1: it does not matter.
        """
        if ends:
            self.ends.add(place.tobytes())
            return
        self.ends.discard(place.tobytes())
        if action >= 0:
            self.tried[self.key(place), action] = None
            if len(self.tried) > _MOST:
                del self.tried[next(iter(self.tried))]

    def enter(self, state: NDArray[np.bool_]) -> None:
        """Take in a state: ``(2N,)``."""
        self.met |= state

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        size = self.hopeless.shape[1]
        plan = self.plan or Plan((), np.zeros((0, size), np.bool_), "")
        tried = [np.frombuffer(place, np.bool_) for place, _ in self.tried]
        ends = [np.frombuffer(place, np.bool_) for place in sorted(self.ends)]
        return {
            "met": self.met,
            "ends": np.array(ends, np.bool_).reshape(len(ends), size),
            "tried": np.packbits(
                np.array(tried, np.bool_).reshape(len(tried), size), axis=1
            ),
            "taken": np.array([action for _, action in self.tried], np.int64),
            "plan": np.array(plan.actions, np.int64),
            "places": plan.places,
            "why": np.array(plan.why, np.str_),
        }

    def restore(self, arrays: Arrays) -> None:
        """Be as the arrays say.

        Raises:
            ValueError: They make no sense.
        """
        self.met = entry(arrays, "met", self.met.shape, np.bool_).copy()
        shape = (rows_in(arrays, "ends"), self.hopeless.shape[1])
        ends = entry(arrays, "ends", shape, np.bool_)
        self.ends = {place.tobytes() for place in ends}
        taken = rows_in(arrays, "taken")
        actions = entry(arrays, "taken", (taken,), np.int64).tolist()
        packed = entry(arrays, "tried", (taken, (shape[1] + 7) // 8), np.uint8)
        tried = np.unpackbits(packed, axis=1, count=shape[1]).astype(np.bool_)
        self.tried = {
            (place.tobytes(), action): None
            for place, action in zip(tried, actions, strict=True)
        }
        steps = rows_in(arrays, "plan")
        actions = entry(arrays, "plan", (steps,), np.int64).tolist()
        places = entry(arrays, "places", (steps, shape[1]), np.bool_)
        why = str(entry(arrays, "why", (), np.str_).item())
        self.plan = Plan(tuple(actions), places, why) if steps else None
