"""Records which states followed each action, for the planner that looks ahead."""

from collections.abc import Collection, Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.plan import WAYS, AnyPlan, ContingentPlan, Plan
from neurosnap.poc.learning.archive import Arrays, entry, rows_in
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import complement

_MOST = 1 << 16  # places that are remembered, each kind of them
BEGINNING: Final = -1
"""Stands for the beginning of an episode where an action may."""


class Experience:
    """The states an agent has met, the actions it tried, and where episodes ended.

    Attributes:
        met: ``(2N,)``: the literals that were in a state.
        looked_at: ``(2N,)``: the literals of a state that make a *place*: what tells
            apart what actions may lead to; see `Body.looked_at`.
        ends: Of places at which an episode ended the last time, what the world's own
            sensors said, the bits packed: what is done there is not seen.
        ended: Places, as `key` tells them apart, each with an action after which the
            next observation began an episode, where another action led on. So the
            episode's own last observation was not shown.
        tried: Places, as `key` tells them apart, each with an action that was taken
            there: the latest, in the order in which they were first.
        hopeless: ``(actions, 2n)``: which results of an action, literals of the world's
            own, seem to be left to chance.
        raised: Places that led no nearer to the target, as `key` tells them apart, and
            how many subgoals farther away each seems to be than it looks.
        surprises: ``(actions + 1, 2)``: trials and surprises so far, of each action and
            last of `BEGINNING`. A trial of an action is where all that it leads to
            seemed to be known, and it had never been taken; a surprise, that something
            else came. An episode that begins is a trial, and a surprise where nothing
            was ever done.
        plan: What is under way; None if nothing is.
        history: Which past readings may be asked for: which ticks are remembered.
        no_way: Places, as bytes, from which a search found no way to the target, each
            with the reason as it is told. Emptied once anything is learned.
        asked_until: The tick until which chance is not asked again, as it told nothing.
    """

    def __init__(self, body: Body) -> None:
        self.met = np.zeros(2 * len(body.sensors), np.bool_)
        self.ends: set[bytes] = set()
        self.ended: dict[tuple[bytes, int], None] = {}
        self.tried: dict[tuple[bytes, int], None] = {}
        self.hopeless = np.zeros((len(body.actions), 2 * len(body.own)), np.bool_)
        self.looked_at = body.looked_at
        self._foreseen = np.ones(2 * len(body.sensors), np.bool_)
        self._unread = ~body.position[: 2 * len(body.own)]  # no part of a place
        self.raised: dict[bytes, int] = {}
        self.surprises = np.zeros((len(body.actions) + 1, 2), np.int64)
        self.plan: AnyPlan | None = None
        self.history = History(0, 64)
        self.no_way: dict[bytes, str] = {}
        self.asked_until = 0

    def aim(self) -> None:
        """Change the target: drop the plan under way, and lower all raised places."""
        self.plan = None
        self.raised.clear()
        self.no_way.clear()
        self.asked_until = 0

    def lift(self, place: bytes, height: int) -> None:
        """Raise a place, given by its `key`, to `height` at least."""
        if height > self.raised.get(place, 0):
            self.raised[place] = height
            if len(self.raised) > _MOST:
                del self.raised[next(iter(self.raised))]

    def note_no_way(self, places: Iterable[bytes], why: str) -> None:
        """Remember that from some places no way leads to the target, and why."""
        if len(self.no_way) > _MOST:
            self.no_way.clear()
        self.no_way.update(dict.fromkeys(places, why))

    def key(self, place: NDArray[np.bool_]) -> bytes:
        """Return the key by which places are told apart.

        It is what is said there of the sensors that some action has a foreseeable
        effect on. Any other reading, a coin's say, is never part of an imagined place.
        """
        return _packed(place & self._foreseen)

    def is_end(self, place: NDArray[np.bool_], action: int) -> bool:
        """Return whether an episode ended at an imagined place. O(n ends) time.

        Args:
            place: ``(2N,)``. Of some sensors it may say nothing: if that is left to
                chance, the rest tells; else it is not known.
            action: What is imagined to lead there.
        """
        here = self._own(place)
        said = here.reshape(-1, 2).any(axis=1).repeat(2)
        unsaid = ~said & self._own(self.looked_at)
        if not self.ends or not unsaid.any() or (unsaid & ~self.hopeless[action]).any():
            return _packed(here) in self.ends
        packed = _rows(self.ends, (here.size + 7) // 8)
        ends = np.unpackbits(packed, axis=1, count=here.size).astype(np.bool_)
        return bool(((ends & said) == here).all(axis=1).any())

    def by_chance(self, place: NDArray[np.bool_], action: int) -> bool:
        """Return whether a place that an action may lead to is left to chance in part.

        What every action leaves to chance, a coin say, tells no place from another.
        """
        unsaid = ~self._own(place).reshape(-1, 2).any(axis=1).repeat(2)
        telling = self._own(self.looked_at & self._foreseen)
        return bool((unsaid & telling & self.hopeless[action]).any())

    def give_up(self, hopeless: NDArray[np.bool_]) -> None:
        """Leave results of actions, ``(actions, 2n)``, to chance."""
        if (hopeless != self.hopeless).any():
            self.no_way.clear()
        self.hopeless = hopeless
        chance = hopeless.all(axis=0).reshape(-1, 2).all(axis=1)
        foreseen = np.ones_like(self._foreseen)
        foreseen[: hopeless.shape[1]] = ~np.repeat(chance, 2)
        if (foreseen != self._foreseen).any():
            self._foreseen = foreseen
            mask = np.packbits(foreseen)
            self.tried, self.ended = (
                {
                    ((np.frombuffer(old, np.uint8) & mask).tobytes(), action): None
                    for old, action in several
                }
                for several in (self.tried, self.ended)
            )

    @property
    def tossed(self) -> NDArray[np.bool_]:
        """``(n,)``: which of the world's own sensors every action leaves to chance."""
        return ~self._own(self._foreseen)[::2]

    @property
    def slipping(self) -> NDArray[np.bool_]:
        """``(n,)``: which of the world's own sensors some action leaves to chance."""
        left: NDArray[np.bool_] = np.logical_or.reduce(self.hopeless, axis=0)
        return np.asarray(left[::2] | left[1::2])

    def is_whole(self, place: NDArray[np.bool_], action: int) -> bool:
        """Return whether all is said of a place that can be said before an action.

        It is ``(2N,)``, or the ``(2n,)`` of the world's own.
        """
        said = self._own(place) | self.hopeless[action] | self._unread
        return bool(said.reshape(-1, 2).any(axis=1).all())

    def count_trial(
        self,
        action: int,
        state: NDArray[np.bool_],
        foretold: NDArray[np.bool_],
        came: NDArray[np.bool_],
    ) -> None:
        """Count an action in a state, ``(2N,)``, as a trial, if it was one.

        Before `leave`. What it guaranteed of the world's own sensors, and what came, is
        ``(2n,)`` each.
        """
        here = self.key(state & self.looked_at)
        if (here, action) not in self.tried and self.is_whole(foretold, action):
            surprise = (complement(foretold) & came).any()
            self.surprises[action] += (1, surprise)

    def meet(self, state: NDArray[np.bool_]) -> None:
        """Remember that a state, ``(2N,)``, was met."""
        if (state & ~self.met).any():
            self.met |= state
            self.no_way.clear()

    def begin(self, state: NDArray[np.bool_]) -> None:
        """Count the beginning of an episode in a state, ``(2N,)``."""
        news = not self._leads_on(self.key(state & self.looked_at))
        self.surprises[BEGINNING] += (1, news)

    def hope(self, action: int) -> float:
        """Return the share of trials of an action to expect a surprise of, in (0, 1).

        It is Laplace's rule of succession: 1/2 before there was any trial.
        """
        trials, surprises = self.surprises[action]
        return float((surprises + 1) / (trials + 2))

    def leave(self, state: NDArray[np.bool_], ends: bool, action: int = -1) -> None:
        """Remember how a state was left: by another episode, or by the next step.

        Args:
            state: ``(2N,)``.
            ends: Whether it was another episode.
            action: The one taken there; -1: it does not matter.
        """
        place = state & self.looked_at
        here, key = _packed(self._own(place)), self.key(place)
        if ends or here in self.ends or (key, action) in self.ended:
            self.no_way.clear()
        if ends and not (action >= 0 and self._leads_on(key)):
            self.ends.add(here)
            return
        # Other actions lead on from here, so the end was a step later and not shown. If
        # this one leads on, too, the agent was moved without `set_down`.
        self.ends.discard(here)
        if action < 0 or (ends and (key, action) in self.tried):
            return
        self.ended.pop((key, action), None)
        several = self.ended if ends else self.tried
        several[key, action] = None
        if len(several) > _MOST:
            del several[next(iter(several))]

    def _leads_on(self, here: bytes) -> bool:
        """Return whether any action was seen to lead on from a place, by its `key`."""
        return any((here, action) in self.tried for action in range(len(self.hopeless)))

    def has_ended(self, place: NDArray[np.bool_], action: int) -> bool:
        """Return whether an action in a place, ``(2N,)``, is one of `ended`."""
        return bool(self.ended) and (self.key(place), action) in self.ended

    def foresees_end(
        self, here: NDArray[np.bool_], action: int, bound: NDArray[np.bool_]
    ) -> bool:
        """Return whether an episode ends by an action, as far as is known.

        Args:
            here: ``(2N,)``, where it is taken.
            action: The one taken.
            bound: ``(2N,)``: what it guarantees.
        """
        ended = self.has_ended(here & self.looked_at, action)
        return ended or self.is_end(bound & self.looked_at, action)

    def _own(self, place: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return place[: self.hopeless.shape[1]]

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        size = len(self.met)
        plan = self.plan or Plan((), np.zeros((0, size), np.bool_), "")
        values, until = np.zeros(0), 0
        after, shares = np.zeros((0, WAYS), np.int64), np.zeros((0, WAYS))
        if isinstance(plan, ContingentPlan):
            values, until = plan.values, plan.until
            after, shares = plan.after, plan.shares
        octets = (size + 7) // 8
        return {
            "met": self.met,
            "ends": _rows(sorted(self.ends), (self.hopeless.shape[1] + 7) // 8),
            "tried": _rows([at for at, _ in self.tried], octets),
            "taken": np.array([action for _, action in self.tried], np.int64),
            "ended": _rows([at for at, _ in self.ended], octets),
            "ending": np.array([action for _, action in self.ended], np.int64),
            "raised": _rows(self.raised, octets),
            "heights": np.array(list(self.raised.values()), np.int64),
            "surprises": self.surprises,
            "plan": np.array(plan.actions, np.int64),
            "places": plan.places,
            "why": np.array(plan.why, np.str_),
            "values": values,
            "after": after,
            "shares": shares,
            "until": np.array(until, np.int64),
            "asked": np.array(self.asked_until, np.int64),
        }

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays; ValueError if they make no sense."""
        self.met = entry(arrays, "met", self.met.shape, np.bool_).copy()
        size = len(self.met)
        octets = (size + 7) // 8
        shape = rows_in(arrays, "ends"), (self.hopeless.shape[1] + 7) // 8
        ends = entry(arrays, "ends", shape, np.uint8)
        self.ends = {place.tobytes() for place in ends}
        self.tried = _moves_in(arrays, "tried", "taken", octets)
        self.ended = _moves_in(arrays, "ended", "ending", octets)
        count = rows_in(arrays, "raised")
        raised = entry(arrays, "raised", (count, octets), np.uint8)
        heights = entry(arrays, "heights", (count,), np.int64).tolist()
        self.raised = {
            place.tobytes(): height
            for place, height in zip(raised, heights, strict=True)
        }
        shape = self.surprises.shape
        self.surprises = entry(arrays, "surprises", shape, np.int64).copy()
        steps = rows_in(arrays, "plan")
        actions = entry(arrays, "plan", (steps,), np.int64)
        places = entry(arrays, "places", (steps, size), np.bool_)
        why = str(entry(arrays, "why", (), np.str_).item())
        until = entry(arrays, "until", (), np.int64).item()
        self.asked_until = entry(arrays, "asked", (), np.int64).item()
        for name, tick in ("until", until), ("asked", self.asked_until):
            if tick < 0:
                raise ValueError(f"{name}: must be 0 or more, got {tick}")
        count = rows_in(arrays, "values")
        values = entry(arrays, "values", (steps if count else 0,), np.float64)
        after = entry(arrays, "after", (count, WAYS), np.int64)
        shares = entry(arrays, "shares", (count, WAYS), np.float64)
        self.plan = None
        if count:
            if not (after.min() >= -1 and after.max() < count):
                rule = f"must be in -1..{count - 1}"
                raise ValueError(f"after: {rule}, got {after.min()} to {after.max()}")
            self.plan = ContingentPlan(
                actions, places, why, values, until, after, shares
            )
        elif steps:
            self.plan = Plan(tuple(actions.tolist()), places, why)


def _rows(places: Collection[bytes], octets: int) -> NDArray[np.uint8]:
    """Return packed places as an array, a row each."""
    return np.frombuffer(b"".join(places), np.uint8).reshape(len(places), octets)


def _moves_in(
    arrays: Arrays, places: str, actions: str, octets: int
) -> dict[tuple[bytes, int], None]:
    """Return places, each with an action, from two arrays."""
    count = rows_in(arrays, actions)
    taken = entry(arrays, actions, (count,), np.int64).tolist()
    rows = entry(arrays, places, (count, octets), np.uint8)
    both = zip(rows, taken, strict=True)
    return {(place.tobytes(), action): None for place, action in both}


def _packed(place: NDArray[np.bool_]) -> bytes:
    return np.packbits(place).tobytes()
