"""Finds contexts in which an action has a reliable effect: the sensors to grow.

Something came that the action taken did not guarantee. The *counterexamples* are the
ticks at which the same action was taken and the opposite came. A *cover* is a set of
literals of the state before that held together at none of them: greedily, the literal
that excludes most of what is left, then the next. Where the same state has led to both,
what was done the step before, and where, is searched as well, grown sensors among it:
so contexts nest as deep as surprises remain. If that tells nothing, a *latch* is looked
for: of two literals, which was read last. The cover is tried before it is believed:
the sensor ``α∧(a₁∧…∧aₖ)`` is born once it was confirmed often enough.

Everything here is counted in whole numbers, and ties go to the lowest number, so that
the same observations lead to the same births.

References:
    Not the paper's, which names "chunking: new conditional sensors" as future work. The
    cover of counterexamples is that of AQ (Michalski 1969) and of version spaces; for
    models of actions see Gil (1994) and Stern & Juba (2017). To look one step back
    where that tells outcomes apart is McCallum's (1996) utile suffix memory; that grown
    sensors count makes it as deep as it has to be.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.latch_search import find_latch
from neurosnap.poc.learning.archive import Arrays, entry, rows_in
from neurosnap.poc.learning.history_questions import (
    Count,
    Numbers,
    Question,
    Search,
    together,
)
from neurosnap.poc.learning.reading_history import following, preceding
from neurosnap.poc.order.literal_sets import Words

ROOM: Final = 120
"""Sensors that may be grown, unless another number is given."""
CONFIRMATIONS: Final = 5
"""Times a cover must hold, after it was found, before its sensor is born."""
HOPELESS: Final = 4
"""A result is left to chance once so many covers of it failed, and so many more for
each that became a sensor."""
LONGEST: Final = 8
"""Literals of a cover at most."""
_FOR_A_MAP = 64  # places of a room that no sensor which looks back may take
RECENT: Final = 16
"""Times that a result of an action came, beyond which older ones count half."""


class Candidates(NamedTuple):
    """The literals that may be part of a context to be grown."""

    literals: Numbers
    """``(n,)``."""
    rings: Numbers
    """``(n,)``: for each the literal that was read at a tick iff it held there."""
    before: bool = False
    """It held at a tick iff that was read at the one before."""


def cover(
    against: Words, several: Sequence[Candidates], ticks: int
) -> Search[tuple[int, ...] | None]:
    """Look for literals that held together at no tick of a set, greedily.

    Args:
        against: ``(W,)``, the ticks.
        several: Those to choose from.
        ticks: How many the history was shown so far.

    Returns:
        Ascending, none of them superfluous; None if there are none, or too many. For
        each that is chosen it asks for a count of all, and for the ring of the chosen
        one.
    """
    literals = np.concatenate([one.literals for one in several])
    rings = np.concatenate([one.rings for one in several])
    before = np.repeat(
        [one.before for one in several], [len(one.rings) for one in several]
    )
    chosen: dict[int, Words] = {}
    left = against
    while left.any():
        if len(chosen) == LONGEST or not len(literals):
            return None
        counts = tuple(
            Count(preceding(left, ticks) if one.before else left, one.rings)
            for one in several
        )
        remain = np.concatenate((yield Question(counts=counts)).counts)
        best = int(remain.argmin())
        if remain[best] == np.bitwise_count(left).sum():
            return None
        ring = rings[best].item()
        read = (yield Question(readings=(ring,))).readings[ring]
        chosen[best] = following(read, ticks) if before[best] else read
        left = left & chosen[best]
    for place in tuple(chosen):
        rest = [one for other, one in chosen.items() if other != place]
        if rest and not (against & np.bitwise_and.reduce(rest)).any():
            del chosen[place]
    return tuple(sorted(literals[list(chosen)].tolist()))


class _Candidate(msgspec.Struct):
    """A cover under trial."""

    action: int
    literals: tuple[int, ...]
    result: int
    held: int = 0

    @property
    def context(self) -> Context:
        return Context(self.action, self.literals)


class Grower:
    """Compares results of actions with predictions, and finds the next sensor to grow.

    Args:
        body: What is sensed and done, with room for what is grown; each action in the
            context of every literal that may be in a cover.

    Attributes:
        hopeless: ``(actions, own literals)``: which results seem to be left to chance.
    """

    def __init__(self, body: Body) -> None:
        self._own = len(body.own)
        self._room = body.room
        self._trials: dict[tuple[int, int], list[_Candidate]] = {}
        self._ready: list[_Candidate] = []
        self._latch: Context | None = None  # the last that was found
        self._adopt(np.zeros((6, len(body.actions), 2 * self._own), np.int64))
        self._maps = len(body.maps)
        self.fit(body)
        # For each action: the literals in whose context it is sensed, and that sensor.
        which, literals = np.array(body.context, np.intp).T
        places = [np.flatnonzero(which == k) for k in range(len(body.actions))]
        first = self._own + len(body.actions)
        self._contexts = [(literals[mine], first + mine) for mine in places]

    def _adopt(self, counts: NDArray[np.int64]) -> None:
        """Go on with these counts, for each action and result."""
        self._counts = counts
        self._failed = counts[0]  # covers in a row
        self._wait = counts[1]  # surprises to let pass
        self._lost = counts[2]  # covers that failed, in all
        self._won = counts[3]  # covers of which sensors were born
        self._came = counts[4]  # times it came lately
        self._missed = counts[5]  # those of them at which nothing guaranteed it
        self._judge()

    @property
    def surprising(self) -> NDArray[np.float64]:
        """``(actions, own literals)``: how often each came unforeseen of late: a share.

        It is 0 of what came fewer than `HOPELESS` times.
        """
        seldom = self._came < HOPELESS
        return np.where(seldom, 0.0, self._missed / np.maximum(self._came, 1))

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._grown = set(body.in_use)
        self._births, self._has_room = len(body.grown), body.has_room
        if len(body.maps) > self._maps:  # what nothing explained, it does
            self._counts[:] = 0
            self._judge()
        self._maps = len(body.maps)
        # What tells of the step before: the actions and the contexts. As those that are
        # grown tell of the step before it, they may look back any number of steps.
        # Of a latch it tells, too, that it was off.
        last = [2 * k for k in body.read if k >= self._own]
        off = [2 * latch + 1 for _, latch in body.latches]
        self._last = np.array([*last, *off], np.intp)
        self._latches = dict(body.latches)
        self._first_grown = body.first_grown
        self._count = body.size
        gone = {2 * (body.first_grown + place) for place in body.retired}
        for some in (self._ready, *self._trials.values()):
            some[:] = [each for each in some if gone.isdisjoint(each.literals)]

    def notice(
        self,
        action: int,
        state: NDArray[np.bool_],
        foretold: NDArray[np.bool_],
        came: NDArray[np.bool_],
        ticks: int,
        begun: Words,
    ) -> Search[int]:
        """Compare what an action led to with what it guaranteed; find what to grow.

        The history that is asked must have the observation after it. Nothing is asked
        where all that came was guaranteed.

        Args:
            action: The one taken.
            state: ``(2N,)``, recorded before.
            foretold: ``(2n,)``, what it guaranteed of the world's own sensors, by what
                was believed before.
            came: ``(2n,)``, what was read of them after it.
            ticks: How many the history was shown so far.
            begun: ``(W,)``, the ticks that began a trajectory.

        Returns:
            How many results that were not guaranteed have no explanation: no cover,
            and no latch.
        """
        unexplained = 0
        self._try(action, state, came, foretold)
        self._came[action] += came
        self._missed[action] += came & ~foretold
        self._counts[4:, action] >>= self._came[action] >= RECENT
        missed = np.flatnonzero(came & ~foretold).tolist()
        results = [one for one in missed if self._is_due(action, state, one)]
        if results:
            taken = 2 * (self._own + action)
            asked = taken, *(result ^ 1 for result in results)
            read = (yield Question(readings=asked)).readings
            against = [read[taken] & read[result ^ 1] for result in results]
            searches = [self._cover(action, state, one, ticks) for one in against]
            covers = yield from together(searches)
            for result, found in zip(results, covers, strict=True):
                latch: Context | None = None
                if found is None and self._births < self._room:
                    latch = yield from find_latch(
                        self._alike(action, state),
                        result,
                        self._first_grown,
                        self._own,
                        ticks,
                        begun,
                        self._latches,
                    )
                if latch is None:
                    unexplained += found is None
                    self._put_on_trial(action, result, found)
                else:
                    self._latch = latch
                    self._counts[:2, action, result] = 0  # look for a cover at once
        return unexplained

    def _try(
        self,
        action: int,
        state: NDArray[np.bool_],
        came: NDArray[np.bool_],
        foretold: NDArray[np.bool_],
    ) -> None:
        """Hold the covers under trial against what came.

        One that was confirmed waits until its result is not guaranteed without it: a
        young sensor believes too much, all that it has met with.
        """
        # In the order of the numbers: what is restored is in no other.
        mine = sorted(key for key, trials in self._trials.items() if trials)
        for which, result in mine:
            if which != action or not came[result | 1] | came[result & ~1]:
                continue
            trials = self._trials[which, result]
            for trial in trials.copy():
                if not state[list(trial.literals)].all():
                    continue
                if came[result]:
                    trial.held += 1
                    if trial.held >= CONFIRMATIONS and not foretold[result]:
                        self._ready.append(trial)
                        trials.remove(trial)
                else:
                    trials.remove(trial)
                    self._fail(action, result)
        for trial in self._ready.copy():
            holds = trial.action == action and state[list(trial.literals)].all()
            if holds and came[trial.result ^ 1]:
                self._ready.remove(trial)
                self._fail(action, trial.result)

    def _fail(self, action: int, result: int) -> None:
        self._failed[action, result] += 1
        self._lost[action, result] += 1
        self._judge()
        self._wait[action, result] = 1 << min(int(self._failed[action, result]), 40)

    def _judge(self) -> None:
        """Tell anew what is left to chance; an array that was given out stays."""
        self.hopeless: NDArray[np.bool_] = self._lost >= HOPELESS * (1 + self._won)

    def _is_due(self, action: int, state: NDArray[np.bool_], result: int) -> bool:
        """Tell whether to look for a cover of what was not guaranteed."""
        trials = self._trials.setdefault((action, result), [])
        under_way = (*trials, *(one for one in self._ready if one.result == result))
        if any(
            one.action == action and state[list(one.literals)].all()
            for one in under_way
        ):
            return False
        if self._wait[action, result]:
            self._wait[action, result] -= 1
            return False
        return True

    def _put_on_trial(
        self, action: int, result: int, literals: tuple[int, ...] | None
    ) -> None:
        """Put a cover that was found on trial; it is None if there is none."""
        if literals is None:
            self._fail(action, result)
            return
        # A sensor that is on in just this context may be there.
        single = len(literals) < 2 and all(a < 2 * self._own for a in literals)
        if not single and Context(action, literals) not in self._grown:
            trials = self._trials[action, result]
            trials.append(_Candidate(action, literals, result))

    def _alike(self, action: int, state: NDArray[np.bool_]) -> list[int]:
        """Return the literals that were read after an action in just this state."""
        literals, sensors = self._contexts[action]
        single = 2 * sensors[state[literals]]
        return [2 * (self._own + action), *single.tolist()]

    def _cover(
        self, action: int, state: NDArray[np.bool_], against: Words, ticks: int
    ) -> Search[tuple[int, ...] | None]:
        """Look for literals of the state that held together at no counterexample.

        Returns None if there are none, or too many.
        """
        literals, sensors = self._contexts[action]
        here = state[literals]
        now = Candidates(literals[here], 2 * sensors[here])
        found = yield from cover(against, [now], ticks)
        if found is None and self._may_look_back:
            last = self._last[state[self._last]]
            both = now, Candidates(last, last, before=True)
            found = yield from cover(against, both, ticks)
        return found

    @property
    def awaited(self) -> set[int]:
        """The latches that a cover is on trial with, or is still looked for with."""
        trials = (one for some in self._trials.values() for one in some)
        looked_at = {a >> 1 for one in (*self._ready, *trials) for a in one.literals}
        last = {latch for each, latch in self._latches.items() if each == self._latch}
        return last | looked_at & {*self._latches.values()}

    @property
    def _may_look_back(self) -> bool:
        """Whether one more context of the step before may be grown.

        In a world where only the past tells there is no end to them, and a map of it
        may take its place.
        """
        kept = 0 if self._maps else _FOR_A_MAP
        return self._births + kept < self._room or self._room <= kept

    def birth(self) -> Context | None:
        """Return the next sensor that is due."""
        if self._latch is not None and self._latch not in self._latches:
            if self._births < self._room:
                return self._latch
            self._latch = None
        while self._ready and self._has_room:
            due = self._ready.pop(0)
            self._failed[due.action, due.result] = 0
            self._wait[due.action, due.result] = 0
            self._won[due.action, due.result] += 1
            self._counts[4:, due.action, due.result] = 0  # it is explained by now
            self._judge()
            looks_back = any(a >= 2 * self._own for a in due.literals)
            if due.context not in self._grown and (
                self._may_look_back or not looks_back
            ):
                return due.context
        return None

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        # In the order of the numbers: one that was restored met them in another order.
        trials = [trial for _, many in sorted(self._trials.items()) for trial in many]
        text = msgspec.json.encode((trials, self._ready, self._latch))
        return {"covers": self._counts, "trials": np.frombuffer(text, np.uint8)}

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays; ValueError if they make no sense."""
        shape = self._counts.shape
        self._adopt(entry(arrays, "covers", shape, np.int64).copy())
        text = entry(arrays, "trials", (rows_in(arrays, "trials"),), np.uint8)
        kind = tuple[list[_Candidate], list[_Candidate], Context | None]
        try:
            trials, self._ready, self._latch = msgspec.json.decode(
                text.tobytes(), type=kind
            )
        except msgspec.DecodeError as error:
            raise ValueError(f"trials: {error}") from error
        _, actions, results = shape
        for one in (*trials, *self._ready):
            known = 0 <= one.action < actions and 0 <= one.result < results
            if not (known and all(0 <= a < 2 * self._count for a in one.literals)):
                raise ValueError(f"trials: must be of what there is, got {one}")
        if (latch := self._latch) is not None:
            both = *latch.literals, latch.reset
            if not all(0 <= a < 2 * self._first_grown for a in both) or len(both) != 2:
                raise ValueError(f"latch: must be of what there is, got {latch}")
        self._trials = {}
        for trial in trials:
            self._trials.setdefault((trial.action, trial.result), []).append(trial)
