"""Runs all methods on one home, and retrains each weekly on past data."""

import functools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tools.paper.homes.baselines import Groups, Logistic, Silence, known
from tools.paper.homes.flagged_sensors import Mention, Method
from tools.paper.homes.health_monitor_method import SEGMENT, Ours, Watched
from tools.paper.homes.home import Home, read_home

LEARNED = 300 * 3600.0
"""Seconds at the beginning of a home that are only learned from."""
WEEK = 7 * 86400.0
HORIZON = 4 * WEEK
"""How long a long fault is waited for."""

_PATIENCE = np.arange(1.9, 0.3, -0.1).tolist()
"""What is tried for the silence rule, below the 2.0 that it begins with."""
_BASELINES: dict[str, Callable[[Home, float], Method]] = {
    "silence rule": Silence,
    "unseen groups": Groups,
    "logistic": Logistic,
}
METHODS = ("health", *_BASELINES)


class Bench:
    """A home and what every method learned of it.

    Args:
        home: The home.
        alarms: The budget of the health monitor.
    """

    def __init__(self, home: Home, alarms: str) -> None:
        self.home = home
        self.start = math.ceil((home.begin + LEARNED) / SEGMENT) * float(SEGMENT)
        """The first segment begins then."""
        count = int((home.end - self.start) // SEGMENT)
        self.segments = self.start + SEGMENT * np.arange(max(0, count))
        """When segments begin."""
        self.known = np.flatnonzero(known(home, self.start))
        """The sensors that faults are put into."""
        self._watched = Watched(home, alarms, self.start)
        self._ours = Ours(self._watched)
        self._weeks = np.arange(self.start, home.end, WEEK).tolist()
        self._baselines: dict[str, list[Method]] = {
            name: [make(home, week) for week in self._weeks]
            for name, make in _BASELINES.items()
        }
        self._make_silence_equal()

    def _make_silence_equal(self) -> None:
        """Give the silence rule the least patience with which it tells no more."""
        name, ours = "silence rule", len(self.clean(METHODS[0]))
        for patience in _PATIENCE:
            before = self._baselines[name]
            rules = [Silence(self.home, week, patience) for week in self._weeks]
            self._baselines[name] = [*rules]
            if len(self.clean(name)) > ours:
                self._baselines[name] = before
                break

    def method(self, name: str, begin: float) -> Method:
        """Return a method as it is at the beginning of a segment."""
        if name == METHODS[0]:
            return self._ours
        week = int(np.searchsorted(self._weeks, begin, side="right")) - 1
        return self._baselines[name][max(0, week)]

    def clean(self, name: str) -> list[Mention]:
        """Return what a method says of the home without faults, after it learned."""
        if name == METHODS[0]:
            return [m for m in self._watched.mentions if m.begin >= self.start]
        found: list[Mention] = []
        for week in self._weeks:
            end = min(week + WEEK, self.home.end)
            said = self.method(name, week).mentions(self.home, week, end)
            # What goes on from the week before began there.
            found += [m for m in said if m.begin > week or week == self.start]
        return found


@functools.cache
def bench(path: str, alarms: str) -> Bench:
    """Return the bench of a home in a file; it is made once in a process."""
    return Bench(read_home(Path(path)), alarms)


def credited(found: list[Mention], twin: list[Mention], onset: float) -> list[Mention]:
    """Return the mentions after an onset that the twin without the fault has not."""
    return [
        m
        for m in found
        if m.begin > onset
        and not any(t.sensor == m.sensor and t.begin <= m.begin <= t.end for t in twin)
    ]
