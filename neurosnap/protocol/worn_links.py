"""Retires implications that break again and again, and lets them return.

A sensor that drifts, or a plant that is changed, breaks the same few implications on
most occasions from then on, and what is told of them drowns all else. So there is a sum
for each that broke, as in Page's test (1954): an occasion on which it breaks, ticks in
a row, adds `WEIGHT`; one on which it held since takes one away, down to 0. At `ENOUGH`
the implication is *retired*: the anomaly of that tick is the last to be told of it. It
returns with the first break at which the sum was 0. What breaks on less than one in
``WEIGHT + 1`` occasions stays, but for chance. Each is judged by itself: nothing that
one has learned is forgotten, and what a fault breaks besides is told.
"""

from collections.abc import Collection, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from neurosnap.poc.learning.archive import Arrays, entry, rows_in
from neurosnap.poc.learning.reading_history import History

WEIGHT: Final = 5
"""How many occasions on which it held one on which it breaks is worth."""
ENOUGH: Final = 5 * WEIGHT
"""The sum from which on an implication is retired: it takes five breaks or more."""
CAP: Final = 2 * ENOUGH
"""The sum at most: so many occasions on which it holds suffice to return, however long
it broke."""
Pair: TypeAlias = tuple[int, int]


class _Wear(NamedTuple):
    last: int  # the last of its breaks, as `History.tick` counts
    total: int  # the sum after it
    since: int  # the tick of the first break since the sum was 0
    retired: int  # the tick of the last break that is told; 0: not yet


class WornLinks:
    """The implications that broke, each with its sum and as the lesser of its forms."""

    def __init__(self) -> None:
        self._worn: dict[Pair, _Wear] = {}

    def follow(
        self, tick: int, links: Collection[Pair], broken: set[Pair], history: History
    ) -> dict[Pair, tuple[int, int]]:
        """Count what a tick breaks.

        Args:
            tick: Larger every time.
            links: Those of which to tell.
            broken: What is counted, some of them.
            history: All readings before it.

        Returns:
            Of each that is retired, at this tick or before, or returns: since when it
            broke too often, and when it was retired, or 0 if it returns.
        """
        names = {pair: min(pair, (pair[1] ^ 1, pair[0] ^ 1)) for pair in links}
        left = self._left(sorted({names[pair] for pair in broken}), history)
        found = dict[Pair, tuple[int, int]]()
        for name in {*names.values()}:
            was = wear = self._worn.get(name, _Wear(-1, 0, tick, 0))
            if name in left:
                since, retired = was[2:] if left[name] else (tick, 0)
                total = min(left[name] + WEIGHT, CAP)
                retired = retired or (tick if total >= ENOUGH else 0)
                wear = _Wear(history.tick, total, since, retired)
                if was.last == history.tick - 1 >= 0:  # the same occasion
                    wear = was._replace(last=history.tick)
                self._worn[name] = wear
            if was.retired or wear.retired:
                found[name] = was.since, wear.retired
        return {pair: found[name] for pair, name in names.items() if name in found}

    def _left(self, names: Sequence[Pair], history: History) -> dict[Pair, int]:
        """Return the sum of each, less the occasions on which it held since."""
        left = dict.fromkeys(names, 0)
        if known := [name for name in names if name in self._worn]:
            ages = [history.tick - 1 - self._worn[name].last for name in known]
            latest = {age: history.latest(age) for age in {*ages}}
            within = np.stack([latest[age] for age in ages], axis=1)
            sources, targets = np.array(known, np.int64).T
            held = history.occasions_held(sources, targets, within)
            for name, count in zip(known, held.tolist(), strict=True):
                left[name] = max(0, self._worn[name].total - count)
        return left

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        rows = sorted((*name, *wear) for name, wear in self._worn.items())
        return {"worn": np.array(rows, np.int64).reshape(-1, 6)}

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays.

        Raises:
            ValueError: They are not of that shape.
        """
        rows = entry(arrays, "worn", (rows_in(arrays, "worn"), 6), np.int64)
        self._worn = {(a, b): _Wear(*wear) for a, b, *wear in rows.tolist()}
