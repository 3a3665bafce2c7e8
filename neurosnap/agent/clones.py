"""Tells apart places that look alike, by what leads to them and what they lead to.

Several places may look the same. A *clone* is one of the places with one look, a *map*
all the clones of a world, with the one to which each action leads from each.

It is found in past readings, in two steps. How often each of many supposed clones led
to each is estimated, again and again until that changes little (Baum & Welch). Then
ticks at which the likeliest clone is the same are taken for one place, and so is
whatever the same actions led to from there. If two that look different become one,
there is no such map. So a map that is found explains all that was read, and leaves
nothing open but where the agent was when its readings began. One reading that is wrong
is enough for none to be found.

References:
    Not the paper's. Clones and their learning are those of clone-structured cognitive
    graphs (George et al. 2021); to merge states of an automaton and whatever follows
    from them is that of RPNI (Oncina & García 1992), which has its own order of trying.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.clone_kernels import (
    Bits,
    Floats,
    Numbers,
    expect,
    likeliest,
    share_out,
    track,
)
from neurosnap.poc.learning.reading_history import in_order
from neurosnap.poc.order.literal_sets import Words

CLONES: Final = 32
"""Clones of each look that are supposed at first. Chosen on drawn rooms of 48 places
and four colours: with 20 half of the searches succeed, with 30 nearly all."""
VISITS: Final = 5
"""Times a place must have been met to be part of a map."""
OPEN: Final = 0.1
"""Bits a tick that the clones leave open, beyond which chance decides too much for a
map. Where one was found in drawn rooms, rings and mazes, they left 0.02 to 0.06."""
_LEAST = 0.002  # what each count begins with
_ROUNDS = 300  # of the expectation, at most
_NEAR = 1e-4  # bits a tick: what improves less in five rounds is good enough


class Walk(NamedTuple):
    """What was read and done, tick by tick."""

    on: Bits
    """``(m, R)``: what was read on, of the sensors that tell places apart."""
    off: Bits
    """``(m, R)``: what was read off."""
    actions: Numbers
    """``(m,)``: the action that led to each; -1: none, or it is not known."""

    @property
    def known(self) -> Bits:
        """``(m,)``: whether all of these sensors were known."""
        told: Bits = np.logical_and.reduce(self.on | self.off, axis=1)
        return told


def walk_in(
    read: Mapping[int, Words],
    sensors: Sequence[int] | NDArray[np.intp],
    taken: Sequence[int],
    ticks: int,
) -> Walk:
    """Return what was read and done from the oldest tick to the newest.

    Args:
        read: By literal ``(W,)``, the ticks at which it was read.
        sensors: ``(R,)``.
        taken: For each action the literal that is on after it.
        ticks: How many there were so far.
    """
    on, off, acts = (
        in_order([read[a] for a in literals], ticks).T
        for literals in (
            [2 * k for k in sensors],
            [2 * k + 1 for k in sensors],
            taken,
        )
    )
    one = acts.sum(axis=1) == 1  # none where a trajectory begins
    return Walk(on, off, np.where(one, acts.argmax(axis=1), -1))


class Map(NamedTuple):
    """The places of a world, some of which look alike; ``K`` clones."""

    looks: Bits
    """``(K, R)``: what is read at each."""
    leads: Numbers
    """``(actions, K)``: the clone to which an action leads from each; -1: unknown."""

    @property
    def is_whole(self) -> bool:
        """Whether it is known where each action leads, but from where none was taken.

        One that is not may hold a place twice, or take two for one.
        """
        known = self.leads >= 0
        return bool((known.all(axis=0) | ~known.any(axis=0)).all())

    def follow(self, walk: Walk, before: Bits | None = None) -> tuple[Bits, int]:
        """Follow where one may be.

        Args:
            walk: What was read and done.
            before: ``(K,)``: where one may have been before it; None: anywhere.

        Returns:
            ``(m, K)``; and at how many ticks what was read goes with no place where one
            may have come to: there it may be any that it goes with. O(m K R) time.
        """
        looks = self.looks.astype(np.float32)
        apart = walk.off.astype(np.float32) @ looks.T
        apart += walk.on.astype(np.float32) @ (1 - looks).T
        possible = np.ones((len(apart) + 1, len(looks)), np.bool_)
        if before is not None:
            possible[0] = before
        lost = track(self.leads, walk.actions, apart == 0, possible)
        return possible[1:], int(lost.sum())


class MapOfSensors(NamedTuple):
    """A map whose clones are sensors."""

    first: int
    """The number of the first clone; the others follow."""
    sensors: NDArray[np.intp]
    """``(R,)``: those of the world's own that make a look."""
    map: Map

    @property
    def numbers(self) -> range:
        """The numbers of the clones."""
        return range(self.first, self.first + len(self.map.looks))

    def leading(self, action: int, literal: int) -> list[int]:
        """Return the clones from which an action leads to where a literal is read."""
        place = np.flatnonzero(self.sensors == literal >> 1)
        leads = self.map.leads[action]
        read = (self.map.looks[leads][:, place] != literal & 1).any(axis=1)
        found: list[int] = (self.first + np.flatnonzero(read & (leads >= 0))).tolist()
        return found

    def carry(
        self, before: NDArray[np.bool_], state: NDArray[np.bool_], action: int
    ) -> None:
        """Say in a state where one may be, and what is to be read there."""
        on, off = 2 * self.sensors, 2 * self.sensors + 1
        clones = slice(2 * self.first, 2 * self.numbers.stop)
        now = Walk(state[on][None], state[off][None], np.array([action], np.int64))
        may, _ = self.map.follow(now, ~before[clones][1::2])
        state[clones][::2] = may[0] & (may.sum() == 1)
        state[clones][1::2] = ~may[0]
        if may.any():
            looks = self.map.looks[may[0]]
            state[on] |= looks.all(axis=0) & ~state[off]
            state[off] |= ~looks.any(axis=0) & ~state[on]


def find_map(walk: Walk, actions: int, attempt: int) -> tuple[Map | None, float]:
    """Look for a map of all that was read.

    Args:
        walk: What was read and done.
        actions: How many there are.
        attempt: Another number draws other chances to begin with.

    Returns:
        The map; None if none is found: another attempt may find one. And how many bits
        a tick the clones leave open: what is left to chance, no attempt will explain.
        It takes about a second for 8,192 ticks: O(m CLONES²) time, up to 300 times.
    """
    known = walk.known
    rows, look = np.unique(walk.on, axis=0, return_inverse=True)
    look = look.reshape(-1)
    joined = known[1:] & known[:-1] & (walk.actions[1:] >= 0)
    if len(rows) < 2 or VISITS * len(rows) > joined.sum():
        return None, math.inf
    steps = (look[:-1] * actions + walk.actions[1:]) * len(rows) + look[1:]
    several, number = np.unique(steps[joined], return_inverse=True)
    kinds = np.full(len(joined), -1, np.int64)
    kinds[joined] = number
    leads, told = _expected(kinds, several // len(rows), attempt)
    clones = likeliest(kinds, leads) + CLONES * look
    ends = [
        int(a) if so else -1 for a, so in zip(walk.actions[1:], joined, strict=True)
    ]
    places = _Places(look.tolist(), ends)
    found = None
    if places.take_for_one(clones, known):
        found = places.as_map(rows, actions)
    return found, -told


def _expected(kinds: Numbers, groups: Numbers, attempt: int) -> tuple[Floats, float]:
    """Return with what chance each clone leads to each, by kind of step.

    And the logarithm of the readings' likelihood, in bits a tick.
    """
    count = len(groups)
    groups = np.unique(groups, return_inverse=True)[1].reshape(-1).astype(np.int64)
    shape = count, CLONES, CLONES
    drawn = np.random.Philox(key=attempt).random_raw(count * CLONES**2)
    counts = (drawn >> np.uint64(11)).astype(np.float64).reshape(shape)
    counts *= 2.0**-53  # in [0, 1), as numpy makes its doubles
    counts += _LEAST
    leads = np.empty_like(counts)
    ahead = np.empty((len(kinds) + 1, CLONES))
    told: list[float] = []
    while len(told) < _ROUNDS:
        share_out(counts, groups, leads)
        likelihood = expect(kinds, leads, ahead, counts, _LEAST)
        told.append(likelihood / math.log(2) / len(kinds))
        # Where chance decides it would go on and on, and come to nothing.
        slow = len(told) > _ROUNDS // 3 and told[-1] < -2 * OPEN
        if slow or (len(told) > 5 and told[-1] - told[-6] < _NEAR):
            break
    return leads, told[-1]


class _Places:
    """Ticks, those at one place taken together (union-find).

    Args:
        looks: The look at each tick.
        actions: What was done after each; -1: nothing that is known.
    """

    def __init__(self, looks: Sequence[int], actions: Sequence[int]) -> None:
        self._look = looks
        self._root = list(range(len(looks)))
        self._size = [1] * len(looks)
        self._leads: list[dict[int, int]] = [{} for _ in looks]
        for tick, action in enumerate(actions):
            if action >= 0:
                self._leads[tick][action] = tick + 1

    def _find(self, tick: int) -> int:
        root = self._root
        while root[tick] != tick:
            tick = root[tick]
        return tick

    def take_for_one(self, clones: Numbers, known: Bits) -> bool:
        """Take ticks with the same clone for one place; False if that cannot be.

        At which the look was not `known`, a tick is left out.
        """
        first: dict[int, int] = {}
        return all(
            self._join(first.setdefault(clone, tick), tick)
            for tick, (clone, told) in enumerate(
                zip(clones.tolist(), known.tolist(), strict=True)
            )
            if told
        )

    def _join(self, one: int, other: int) -> bool:
        """Take two ticks for one place, and what the same actions led to from them.

        Returns:
            False, and all is as it was, if two that look different would be one.
        """
        done: list[tuple[int, int, list[int]]] = []
        due = [(one, other)]
        while due:
            a, b = map(self._find, due.pop())
            if a == b:
                continue
            if self._look[a] != self._look[b]:
                self._undo(done)
                return False
            if self._size[a] < self._size[b]:
                a, b = b, a
            self._root[b] = a
            self._size[a] += self._size[b]
            added = [
                action for action in self._leads[b] if action not in self._leads[a]
            ]
            for action, after in self._leads[b].items():
                if action in added:
                    self._leads[a][action] = after
                else:
                    due.append((self._leads[a][action], after))
            done.append((a, b, added))
        return True

    def _undo(self, done: list[tuple[int, int, list[int]]]) -> None:
        for a, b, added in reversed(done):
            self._root[b] = b
            self._size[a] -= self._size[b]
            for action in added:
                del self._leads[a][action]

    def as_map(self, rows: Bits, actions: int) -> Map | None:
        """Return the places that were met often, each once; None if it is but one.

        Those that nothing tells apart are one: they look alike, and so does all that
        was seen to follow.
        """
        roots = [
            tick
            for tick, root in enumerate(self._root)
            if root == tick and self._size[tick] >= VISITS
        ]
        for number, one in enumerate(roots):
            for other in roots[:number]:
                if self._look[self._find(one)] == self._look[self._find(other)]:
                    self._join(one, other)
        kept = list(dict.fromkeys(map(self._find, roots)))
        if len(kept) < 2:
            return None
        leads = np.full((actions, len(kept)), -1, np.int64)
        for number, tick in enumerate(kept):
            for action, after in self._leads[tick].items():
                if (place := self._find(after)) in kept:
                    leads[action, number] = kept.index(place)
        return Map(rows[[self._look[tick] for tick in kept]], leads)
