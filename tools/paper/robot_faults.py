"""Faults of the simulated robot, and what several methods say of them by the minute.

Every method learns the same readings of a robot that is well. Then time forks: one of
its futures has no fault, in each of the others something is wrong from the start.
"""

from copy import deepcopy
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from neurosnap import EmpiricalSnapshot
from neurosnap.health.level_evidence import Levels
from neurosnap.health.machine_monitor import MachineMonitor
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.protocol.anomaly_report import with_support
from tools.paper.table import Entry
from world.robot import AFFECTED, STEP, FaultKind, Robot, RobotFault, distances
from world.robot_world import SENSOR_TOPICS, RobotTopics, near, sensed

Bits = NDArray[np.bool_]
Floats = NDArray[np.float64]

CASES: tuple[FaultKind | None, ...] = (None, *AFFECTED)
SPANS = 1, 5
"""Minutes that the two common methods look at at once."""
METHODS = (
    *("health", "anomalies", "topic rates"),
    *(f"isolation forest, {span} min" for span in SPANS),
    *(f"autoencoder, {span} min" for span in SPANS),
)
_EVERY = 2  # steps from one reading to the next
_MINUTE = round(60 / STEP / _EVERY)
_SECOND = round(1 / STEP / _EVERY)
_LATELY = 4  # hours that anomalies learn from: it takes minutes, and each tick costs
_SUPPORT = 10  # as a run has it by itself
_WINDOW, _LISTENED = 10, 20  # seconds and minutes of topics
_CHUNK = 2048
_SECTORS = [topic == "/scan" for topic in SENSOR_TOPICS.values()]


class Seen(NamedTuple):
    """Readings of a robot."""

    bits: Bits
    """``(n, sensors)``; what is not published any more stays as it was."""
    known: Bits
    """``(sensors,)``, what is published."""


def observed(robot: Robot, minutes: int) -> Seen:
    """Let a robot go on, and return what it reads five times a second."""
    rows, places, frozen = [], [], []
    unseen = [False] * sum(_SECTORS)
    for number in range(minutes * _MINUTE * _EVERY):
        robot.step()
        if number % _EVERY == 0:
            rows.append(sensed(robot, unseen))
            places.append((robot.x, robot.y, robot.heading))
            frozen.append(robot.failing("frozen") == "scan")
    bits, at = np.array(rows), np.array(places)
    rng = np.random.default_rng(len(rows))
    for first in range(0, len(bits), _CHUNK):  # what fits a cache
        part = slice(first, first + _CHUNK)
        ranges = distances(robot.room, *at[part].T)
        ranges += 0.01 * rng.standard_normal(ranges.shape)
        bits[part, _SECTORS] = near(ranges)
    still = np.flatnonzero(frozen)
    if len(still):
        bits[np.ix_(still, np.array(_SECTORS))] = bits[still[0], _SECTORS]
    silent = robot.failing("silent")
    known = np.array([topic != silent for topic in SENSOR_TOPICS.values()])
    bits[:, ~known] = bits[0, ~known]
    return Seen(bits, known)


class MinuteMethod(Protocol):
    """Says of each minute how wrong a robot seems."""

    def scores(self, seen: Seen) -> Floats:
        """Return a number a minute; it begins where the past ended."""


class _Health:
    def __init__(self, past: Seen) -> None:
        self._monitor = MachineMonitor(list(SENSOR_TOPICS), "1/week", "UTC", 1.0)
        self._monitor.follow(_levels(past), 0)
        self._seconds = len(past.bits) // _SECOND

    def scores(self, seen: Seen) -> Floats:
        """Return how many alarms begin in each minute."""
        begun, _ = deepcopy(self._monitor).follow(_levels(seen), self._seconds)
        found = np.zeros(len(seen.bits) // _MINUTE)
        for alarm in begun:
            found[int(alarm.at - 1 - self._seconds) // 60] += 1
        return found


def _levels(seen: Seen) -> Levels:
    """Return for which share of each second every sensor was on."""
    on = seen.bits.reshape(-1, _SECOND, seen.bits.shape[1]).mean(1)
    return Levels(on, np.tile(seen.known.astype(float), (len(on), 1)))


class _Anomalies:
    def __init__(self, past: Seen) -> None:
        sensors = past.bits.shape[1]
        self._snapshot = EmpiricalSnapshot(sensors, "auto")
        self._detector = AnomalyDetector(sensors, support=_SUPPORT)
        self._tick = 0
        self.count(Seen(past.bits[-_LATELY * 60 * _MINUTE :], past.known))

    def scores(self, seen: Seen) -> Floats:
        """Return how many anomalies are told in each minute."""
        return deepcopy(self).count(seen)

    def count(self, seen: Seen) -> Floats:
        """Return the same, and remember what was seen."""
        found = np.zeros(len(seen.bits) // _MINUTE)
        changes = np.flatnonzero((seen.bits[1:] != seen.bits[:-1]).any(1)) + 1
        for at in [0, *changes.tolist()]:
            bits, known = seen.bits[at], seen.known
            self._tick += 1
            believed = self._snapshot.poc_graph()
            anomaly = self._detector.watch(
                self._tick, believed, bits, known, self._snapshot
            )
            self._snapshot.learn(bits, known)
            if anomaly is not None and with_support(anomaly, _SUPPORT) is not None:
                found[at // _MINUTE] += 1
        return found


class _Outliers:
    """A common method of one class, on how long and how often each sensor is on."""

    def __init__(self, past: Seen, name: str) -> None:
        from sklearn.ensemble import IsolationForest
        from sklearn.neural_network import MLPRegressor

        self._span = int(name.split()[-2])
        rows = self._features(past)
        self._mean, self._scale = rows.mean(0), rows.std(0) + 1e-9
        rows = (rows - self._mean) / self._scale
        if name.startswith("isolation"):
            forest = IsolationForest(n_estimators=200, random_state=0).fit(rows)
            self._score = lambda rows: -forest.score_samples(rows)
        else:
            shape = {"hidden_layer_sizes": (32, 8, 32), "max_iter": 400}
            network = MLPRegressor(**shape, early_stopping=True, random_state=0)
            network.fit(rows, rows)
            self._score = lambda rows: ((network.predict(rows) - rows) ** 2).mean(1)

    def scores(self, seen: Seen) -> Floats:
        """Return how unusual each minute is, with those before."""
        rows = (self._features(seen) - self._mean) / self._scale
        return np.asarray(self._score(rows))  # type: ignore[no-untyped-call]

    def _features(self, seen: Seen) -> Floats:
        bits = seen.bits
        rises = np.concatenate([bits[:1], bits[1:] & ~bits[:-1]])
        both = np.concatenate([bits, rises], 1)
        rows = both.reshape(-1, _MINUTE, both.shape[1]).sum(1).astype(float)
        return trailing(rows, self._span)


def trailing(rows: Floats, count: int) -> Floats:
    """Return the mean of each row and those before it, `count` in all."""
    sums = np.cumsum(np.concatenate([np.zeros_like(rows[:1]), rows]), axis=0)
    ends = np.arange(1, len(rows) + 1)
    begins = np.maximum(ends - count, 0)
    many = (ends - begins).reshape(-1, *[1] * (rows.ndim - 1))
    return np.asarray((sums[ends] - sums[begins]) / many)


def rates(robot: Robot) -> NDArray[np.int64]:
    """Let a robot go on, and return how often it publishes: ``(windows, topics)``."""
    topics = RobotTopics(robot)
    begin = robot.time
    names = list(dict.fromkeys(SENSOR_TOPICS.values()))
    counts = np.zeros((_LISTENED * 60 // _WINDOW + 1, len(names)), np.int64)
    for _ in range(round(_LISTENED * 60 / STEP)):
        for said in topics.step():
            window = int((said.at - begin) // _WINDOW)
            counts[window, names.index(said.topic)] += 1
    return counts[:-1]


class RobotEntry(Entry, frozen=True, kw_only=True):
    """What all methods say of one robot a run, well and with each kind of fault."""

    VERSION = 3

    learned: int
    """Days that are learned."""
    judged: int
    """Days without a fault that are judged."""
    hours: int
    """How long a fault is waited for."""

    def row(self, run: int) -> NDArray[np.float32]:
        """Return scores, ``(cases, methods, minutes)``, not a number where none is."""
        seed = self.seed + run
        robot = Robot(seed)
        past = observed(robot, self.learned * 1440)
        least = rates(deepcopy(robot)).min(0)
        methods: list[MinuteMethod | None] = [_Health(past)]
        methods += [_Anomalies(past), None]
        methods += [_Outliers(past, name) for name in METHODS[len(methods) :]]
        made = np.full(
            (len(CASES), len(METHODS), self.judged * 1440), np.nan, np.float32
        )
        for case, kind in enumerate(CASES):
            future, minutes = deepcopy(robot), self.judged * 1440
            if kind is not None:
                future.fault = RobotFault.drawn(kind, robot.time + STEP, seed)
                minutes = self.hours * 60
            heard = (1 - rates(deepcopy(future)) / least).max(1)
            seen = observed(future, minutes)
            for place, method in enumerate(methods):
                if method is None:
                    by_minute = heard.reshape(-1, 60 // _WINDOW).max(1)
                    made[case, place, : len(by_minute)] = by_minute.clip(0)
                else:
                    made[case, place, :minutes] = method.scores(seen)
        return made
