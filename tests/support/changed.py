"""Pairs of recordings of a simulated machine, the second with a planted change or none.

Half of the machines have chains, exclusions and copies as `planted` has them, with
values that hold on; the others go through cycles of steps of varying length. Changes
are planted on sensors that change often enough to tell.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from tests.support.planted import planted

KINDS = (
    "stuck on",
    "stuck off",
    "flips",
    "swapped",
    "removed",
    "added",
    "later",
    "inverted",
)
_ROWS = 10_000
_WAIT = 3
"""Ticks that a delay grows by."""
Table = NDArray[np.bool_]


@dataclass(frozen=True)
class Pair:
    """Two recordings of one machine."""

    good: Table
    """``(T, N)``."""
    new: Table
    changed: frozenset[int]
    """The sensors that the change is planted on; a suspicion of any is right."""


def recorded_twice(kind: str, seed: int) -> Pair:
    """Return two recordings; `kind` is one of `KINDS`, or empty for no change."""
    chance = np.random.default_rng((seed, 7))
    table, related, free = (_holding, _cycling)[seed % 2](chance)
    noise = chance.choice([0, 0.002, 0.01])
    first, second = (int(k) for k in chance.permutation(free)[:2])
    delay = int(chance.integers(1, 5))
    table[:, second] = np.roll(table[:, first], delay)
    good, new = table[:_ROWS].copy(), table[_ROWS:].copy()
    one, other = related[chance.integers(len(related))]
    changed = {one}
    if kind == "stuck on":
        new[:, one] = True
    elif kind == "stuck off":
        new[:, one] = False
    elif kind == "flips":
        new[:, one] ^= chance.random(_ROWS) < 0.05
    elif kind == "inverted":
        new[:, one] = ~new[:, one]
    elif kind == "swapped":
        # Of one relation each it cannot be told which two are swapped.
        times = Counter(chain(*related))
        one, *others = chance.permutation([k for k in times if times[k] > 1]).tolist()
        near = {k for pair in related if one in pair for k in pair}
        changed = {one, next(k for k in others if k not in near)}
        new[:, sorted(changed)] = new[:, sorted(changed, reverse=True)]
    elif kind == "removed":
        turns = chance.random(_ROWS) < 2 * np.diff(new[:, one]).mean()
        turns[0] = True
        last = np.maximum.accumulate(np.where(turns, np.arange(_ROWS), 0))
        new[:, one] = (chance.random(_ROWS) < new[:, one].mean())[last]
        changed = {one, other}
    elif kind == "added":
        one, other = chance.permutation([k for k in free if k != second])[:2].tolist()
        new[:, one] = new[:, other]
        changed = {one, other}
    elif kind == "later":
        new[:, second] = np.roll(table[:, first], delay + _WAIT)[_ROWS:]
        changed = {first, second}
    flips = chance.random((2, *good.shape)) < noise
    return Pair(good ^ flips[0], new ^ flips[1], frozenset(changed))


def _holding(
    chance: np.random.Generator,
) -> tuple[Table, list[tuple[int, int]], list[int]]:
    """Return readings, pairs that are related, and sensors without a relation."""
    made = planted(
        int(chance.integers(2**31)),
        0,
        sensors=100,
        rows=2 * _ROWS,
        hold=chance.choice([0, 0.5, 0.9, 0.95]),
    )
    pairs = [*made.covers, *map(tuple, made.exclusions), *map(tuple, made.copies)]
    free = set(range(100)).difference(*pairs)
    rates = made.table.mean(axis=0)
    lively = [k for k in sorted(free) if 0.1 < rates[k] < 0.9]
    return made.table, sorted((a, b) for a, b in pairs), lively


def _cycling(
    chance: np.random.Generator,
) -> tuple[Table, list[tuple[int, int]], list[int]]:
    """Return the same of three machines and of ten sensors that have no relation."""
    table = np.zeros((2 * _ROWS, 46), np.bool_)
    related = []
    for machine in range(13):
        least = chance.integers(3, 12, 8)
        steps = len(least) * 2 * _ROWS
        lengths = np.tile(least, steps // 8) + chance.geometric(0.3, steps)
        step = np.repeat(np.arange(steps) % 8, lengths)[: 2 * _ROWS]
        if machine >= 3:  # one sensor each
            table[:, 33 + machine] = step < chance.integers(2, 7)
            continue
        begins, spans = chance.integers(0, 8, 12), chance.integers(1, 5, 12)
        for k in range(12):
            on = (step - begins[k]) % 8 < spans[k]
            table[:, 12 * machine + k] = np.roll(on, chance.integers(0, 5))
        for a in range(12):
            for b in range(12):
                inside = (begins[a] - begins[b]) % 8
                if a != b and inside + spans[a] <= spans[b]:
                    related.append((12 * machine + a, 12 * machine + b))
    return table, related, list(range(36, 46))
