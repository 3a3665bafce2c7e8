"""What the parts of a swarm have spent of the processors' time, while it goes on."""

from collections import Counter

import psutil

from neurosnap.runtime.registry import parts_of


class Spent:
    """What each kind of part has spent, at some of a run's ticks.

    Args:
        begin: The first tick to look at: all parts are up by then.
    """

    def __init__(self, begin: int) -> None:
        self._begin = begin
        self._parts = 0
        self._seen: list[tuple[int, Counter[str]]] = []

    def look(self, tick: int) -> None:
        """Look at the parts that this process has started, unless some have ended."""
        if tick < self._begin:
            return
        spent: Counter[str] = Counter()
        found = [*parts_of(psutil.Process())]
        for who, process in found:
            try:
                times = process.cpu_times()
            except psutil.NoSuchProcess:
                return
            spent[who.partition("/")[0]] += times.user + times.system
        self._parts = self._parts or len(found)
        if len(found) == self._parts:
            self._seen.append((tick, spent))

    def a_tick(self, least: int) -> dict[str, float]:
        """Return the seconds a tick of each kind of part, between first and last look.

        Args:
            least: Ticks that must lie between them.
        """
        (first, before), (last, after) = self._seen[0], self._seen[-1]
        if last - first < least:
            raise RuntimeError(f"ticks {first} to {last}: must be {least} at least")
        return {part: (after[part] - before[part]) / (last - first) for part in after}
