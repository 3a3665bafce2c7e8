"""Runs the health monitor once over a home, forking the run for each fault."""

import bisect
from copy import deepcopy

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.alarm_budget import parse_budget, shares
from neurosnap.health.evidence import JudgedSteps, follow, speaks
from neurosnap.health.expectation import WINDOWS, features
from neurosnap.health.judge import WELL, Judge
from neurosnap.health.learn_normal import LearnedRates, heard, per_step
from neurosnap.health.monitor import QUIET, HealthMonitor
from neurosnap.health.tail_probability import weekly
from neurosnap.health.ten_minute_steps import STEP, Steps, parts_of_day
from tools.paper.homes.flagged_sensors import Mention
from tools.paper.homes.home import Home

SEGMENT = 6 * 3600
"""Seconds of a segment; faults branch off where one begins."""


class Watched:
    """A home without faults, followed from its beginning to its end.

    Args:
        home: The home.
        alarms: The budget.
        start: The first segment begins then, seconds since 1970.
    """

    def __init__(self, home: Home, alarms: str, start: float) -> None:
        self.home = home
        self.alarms = alarms
        self.begins: list[float] = []
        self.mentions: list[Mention] = []
        self.judges: list[Judge] = []
        self.learned: list[LearnedRates] = []
        self.known: list[bool] = []
        """Of each step, whether its readings count."""
        monitor = HealthMonitor(home.sensors, alarms, home.zone)
        self.steps = home.steps(home.begin, home.end)
        open_: dict[int, float] = {}
        for at in range(len(self.steps)):
            now = float((self.steps.first + at) * STEP)
            if now >= start and (now - start) % SEGMENT == 0 and monitor.learned:
                self.begins.append(now)
                self.judges.append(deepcopy(monitor.judge))
                self.learned.append(monitor.learned)
            one = slice(at, at + 1)
            steps = self.steps
            monitor.follow(
                Steps(steps.came_on[one], steps.longest[one], steps.first + at)
            )
            self.known.append(monitor.quiet <= QUIET)
            _note(monitor.judge, now + STEP, open_, self.mentions)
        self.mentions += [Mention(s, at, home.end) for s, at in open_.items()]
        self.mentions.sort(key=lambda mention: mention.begin)

    def at(self, begin: float) -> tuple[Judge, LearnedRates]:
        """Return the state at the beginning of a segment."""
        place = bisect.bisect_left(self.begins, begin)
        return deepcopy(self.judges[place]), self.learned[place]


class Ours:
    """The health monitor.

    Args:
        watched: The home.
    """

    def __init__(self, watched: Watched) -> None:
        self._watched = watched
        self._rates: dict[tuple[int, int, int], NDArray[np.float64]] = {}

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the sensors in alarm."""
        judge, learned = self._watched.at(begin)
        steps = home.steps(begin, end)
        known = self._watched.known[int(begin // STEP) - self._watched.steps.first :]
        mentions: list[Mention] = []
        open_: dict[int, float] = {
            int(s): begin for s in np.flatnonzero(judge.kind != WELL)
        }
        for at in range(len(steps)):
            number = steps.first + at
            read = steps.came_on[at], steps.longest[at]
            judge.step(learned, number, *read, np.full(len(home.sensors), known[at]))
            _note(judge, float((number + 1) * STEP), open_, mentions)
        mentions += [Mention(s, at, end) for s, at in open_.items()]
        return sorted(mentions, key=lambda mention: mention.begin)

    def since(self, home: Home, sensor: int, begin: float, end: float) -> float | None:
        """Return when a sensor is first in alarm and its twin without the fault is not.

        Only its own evidence is followed: that of the others is as it was.
        """
        watched = self._watched
        judge, learned = watched.at(begin)
        found = [
            self._alone(deepcopy(judge), learned, each, sensor, begin, end)
            for each in (home, watched.home)
        ]
        alarm = np.flatnonzero(found[0] & ~found[1])
        return None if not len(alarm) else begin + (int(alarm[0]) + 1) * float(STEP)

    def _alone(
        self,
        judge: Judge,
        learned: LearnedRates,
        home: Home,
        sensor: int,
        begin: float,
        end: float,
    ) -> NDArray[np.bool_]:
        """Return in which steps a sensor would be in alarm."""
        whole = self._watched.steps
        low, high = int(begin // STEP) - whole.first, int(end // STEP) - whole.first
        high = min(high, len(whole))
        own = home.steps_of_one(sensor, begin, end)
        rates, near = self._expected(learned, low, high)
        one = slice(sensor, sensor + 1)
        count = high - low
        trace = np.zeros((count, 1, judge.evidence.shape[1]))
        due = np.zeros((count, 1))
        known = np.array(self._watched.known[low:high])[:, None]
        read = own.came_on[:count], own.longest[:count], known
        cut = np.ascontiguousarray
        follow(
            cut(judge.clocks[:, one]),
            cut(judge.sums[:, one]),
            cut(learned.scales[:, one]),
            learned.least,
            JudgedSteps(cut(rates[:, :, one]), cut(near[:, one]), *read),
            trace,
            due,
        )
        allowed = shares(
            parse_budget(self._watched.alarms),
            int(learned.known.sum()),
            len(judge.raised),
        )
        often = weekly(learned.tails[sensor][None], trace[:, 0])
        over = (often <= allowed) & speaks(trace[:, 0], due[:, 0])
        return np.asarray((over & learned.judged[sensor]).any(1))

    def _expected(
        self, learned: LearnedRates, low: int, high: int
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the rates that the home without faults gives."""
        whole = self._watched.steps
        active = whole.came_on > 0
        key = id(learned), low, high
        if key not in self._rates:
            parts = parts_of_day(whole.first + low, high - low, learned.zone)
            self._rates.clear()
            rows = np.arange(low, high)
            rates = np.array(
                [
                    features(active, parts, window, rows) @ learned.weights[at]
                    for at, window in enumerate(WINDOWS)
                ]
            )
            self._rates[key] = per_step(rates, rates[0])
        return self._rates[key], heard(active)[low:high]


def _note(
    judge: Judge, now: float, open_: dict[int, float], mentions: list[Mention]
) -> None:
    """Take note of alarms that begin and end."""
    bad = set(np.flatnonzero(judge.kind != WELL).tolist())
    well = [sensor for sensor in open_ if sensor not in bad]
    mentions += [Mention(sensor, open_.pop(sensor), now) for sensor in well]
    for sensor in bad:
        open_.setdefault(sensor, now)
