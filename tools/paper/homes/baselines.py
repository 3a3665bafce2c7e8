"""Baselines: simple ways to find broken sensors, trained on the monitor's data."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.learn_normal import ACTIVATIONS
from tools.paper.homes.flagged_sensors import HOUR, Mention, joined
from tools.paper.homes.home import Home

Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

_MINUTE = 60.0
# Logistic regression: seconds learned from, and Newton's method.
_MEMORY = 56 * 86400.0
_RIDGE = 1.0
_ROUNDS = 12


class _Baseline:
    """What the baselines have in common: what they know, and when they first name."""

    def __init__(self, home: Home, until: float) -> None:
        self.home = home
        self.known = known(home, until)

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the sensors named."""
        raise NotImplementedError

    def since(self, home: Home, sensor: int, begin: float, end: float) -> float | None:
        """Return when a sensor is first named and its twin is not."""
        twin = [m for m in self.mentions(self.home, begin, end) if m.sensor == sensor]
        for mention in self.mentions(home, begin, end):
            if mention.sensor == sensor and not any(
                other.begin <= mention.begin <= other.end for other in twin
            ):
                return mention.begin
        return None


def known(home: Home, until: float) -> Flags:
    """Return which sensors came on often enough before a time to be judged."""
    return np.array(
        [(spans[:, 0] < until).sum() >= ACTIVATIONS for spans in home.spans]
    )


class Silence(_Baseline):
    """Flags a sensor that is silent for a multiple of its longest silence so far."""

    def __init__(self, home: Home, until: float, patience: float = 2.0) -> None:
        super().__init__(home, until)
        self._patience = patience
        self._times, _ = home.events(home.begin, home.end + 1)
        self._longest = np.array([self._long(s, until) for s in range(len(home.spans))])

    def _long(self, sensor: int, until: float) -> float:
        own = self.home.spans[sensor][:, 0]
        own = own[own < until]
        if not len(own):
            return np.inf
        at = np.searchsorted(self._times, np.append(own, until))
        return float((np.diff(at) - 1).clip(min=0).max())

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the silences that are too long."""
        times, who = home.events(begin, end)
        found: list[Mention] = []
        for sensor in np.flatnonzero(self.known):
            found += self._of(int(sensor), times, who, begin, end)
        return sorted(found, key=lambda mention: mention.begin)

    def since(self, home: Home, sensor: int, begin: float, end: float) -> float | None:
        """Return when a sensor is first named and its twin is not."""
        if not self.known[sensor]:
            return None
        versions = [
            self._of(sensor, *each.events(begin, end), begin, end)
            for each in (home, self.home)
        ]
        for mention in versions[0]:
            if not any(m.begin <= mention.begin <= m.end for m in versions[1]):
                return mention.begin
        # A silence that the twin ends and the fault does not is the fault's from there.
        if versions[0] and versions[0][-1].end >= end:
            last = [m.end for m in versions[1] if m.begin <= versions[0][-1].begin]
            return max(last) if last and max(last) < end else None
        return None

    def _of(
        self,
        sensor: int,
        times: Floats,
        who: NDArray[np.int64],
        begin: float,
        end: float,
    ) -> list[Mention]:
        most = self._patience * self._longest[sensor]
        before = self.home.spans[sensor][:, 0]
        last = before[before < begin]
        passed = 0.0
        if len(last):
            low, high = np.searchsorted(self._times, [last[-1], begin])
            passed = float(max(0, high - low - 1))
        found = []
        own = np.flatnonzero(who == sensor)
        edges = [-1, *own.tolist(), len(times)]
        for left, right in pairwise(edges):
            start = passed if left < 0 else 0.0
            need = int(np.floor(most - start)) + 1
            at = left + max(need, 0)
            stop = float(times[right]) if right < len(times) else end
            if need <= 0:
                found.append(Mention(sensor, begin, stop))
            elif at < right:
                found.append(Mention(sensor, float(times[at]), stop))
        return found


class Groups(_Baseline):
    """Flags sensors that make a minute, or a transition, unlike any in the past."""

    def __init__(self, home: Home, until: float) -> None:
        super().__init__(home, until)
        sets = _came_on(home, home.begin, until, _MINUTE)
        keys = [row.tobytes() for row in sets]
        self._groups = np.unique(sets, axis=0)
        self._seen = set(keys)
        self._went = set(pairwise(keys))

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the sensors that are in the way."""
        sets = _came_on(home, begin, end, _MINUTE)
        points: list[tuple[float, int]] = []
        before = None
        for minute, row in enumerate(sets):
            key = row.tobytes()
            time = begin + (minute + 1) * _MINUTE
            if key not in self._seen:
                far = (self._groups != row).sum(1)
                near = self._groups[far.argmin()]
                points += [(time, int(s)) for s in np.flatnonzero(near != row)]
            elif (
                before is not None
                and before[0] in self._seen
                and (before[0], key) not in self._went
            ):
                moved = np.flatnonzero(before[1] != row)
                points += [(time, int(s)) for s in moved]
            before = key, row
        return joined(points, _MINUTE)


class Logistic(_Baseline):
    """Logistic regression of each sensor on the others, in windows of an hour.

    Names a sensor whose reading is less probable than any was in the last fifth of what
    was learned from; the first four fifths give the weights.
    """

    def __init__(self, home: Home, until: float) -> None:
        super().__init__(home, until)
        on = _came_on(home, max(home.begin, until - _MEMORY), until, HOUR)
        split = len(on) * 4 // 5
        self._weights = np.array(
            [_fit(on[:split], s) for s in range(len(home.sensors))]
        ).T
        late = self._surprise(on[split:])
        self._most = float(late.max(initial=0.0))

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the sensors that surprise."""
        over = self._surprise(_came_on(home, begin, end, HOUR)) > self._most
        points = [
            (begin + (int(hour) + 1) * HOUR, int(s)) for hour, s in np.argwhere(over)
        ]
        return joined(points, _MINUTE)

    def _surprise(self, on: Flags) -> Floats:
        logit = _with_one(on) @ self._weights
        return np.asarray(np.logaddexp(0, np.where(on, -logit, logit)) * self.known)


def _came_on(home: Home, begin: float, end: float, width: float) -> Flags:
    """Return which sensors came on in each window, ``(windows, sensors)``."""
    times, who = home.events(begin, end)
    made = np.zeros((int((end - begin) // width), len(home.sensors)), np.bool_)
    at = ((times - begin) // width).astype(int)
    inside = at < len(made)
    made[at[inside], who[inside]] = True
    return made


def _with_one(on: Flags) -> Floats:
    return np.column_stack([on.astype(float), np.ones(len(on))])


def _fit(on: Flags, sensor: int) -> Floats:
    """Return weights by Newton's method, with a ridge; a sensor has none for itself."""
    inputs = _with_one(on)
    inputs[:, sensor] = 0
    weights = np.zeros(inputs.shape[1])
    ridge = np.full(len(weights), _RIDGE)
    ridge[-1] = 1e-3
    for _ in range(_ROUNDS):
        chance = 1 / (1 + np.exp(-(inputs @ weights).clip(-30, 30)))
        slope = inputs.T @ (on[:, sensor] - chance) - ridge * weights
        bend = (inputs * (chance * (1 - chance))[:, None]).T @ inputs
        weights = weights + np.linalg.solve(bend + np.diag(ridge), slope)
    return weights
