"""Surveys a graph of ROS 2: what is published how often, and which sensors it gives.

Booleans and numbers are sensors by their names, words one each. Where a type is known
for what it says, a condition reads it: a charge that is low, something near in a part
of a scan, a status that warns.
"""

import re
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.sources.conditions import Choice, is_condition
from neurosnap.sources.cuts import Signal
from neurosnap.sources.message_fields import Term, fields
from neurosnap.sources.ros2.diagnostics import ARRAY
from neurosnap.sources.ros2.graph import RosGraph
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.ros2.ros2_source import Ros2Feeder
from neurosnap.sources.ros2.through_rclpy import RclpyFeeder
from neurosnap.sources.wanted import Wanted

if TYPE_CHECKING:
    from neurosnap.sources.ros2.keys_and_tokens import Endpoint

_PERIODS = 1024  # of a topic that are looked at
_SIGNALS = 4096  # that are kept
_OWN = ("/rosout", "/parameter_events")  # every node has these
_STALE, _USUAL = 3, 0.9  # usual gaps, which as many of them are not longer than
_SHORTEST = 0.1  # seconds in which a topic is heard: a tick's
_SECTORS = 8
_ITEM = re.compile(r"\[\d+\]|covariance|\.header\.")
_SPEEDS = {
    "geometry_msgs/msg/Twist": "",
    "geometry_msgs/msg/TwistStamped": ".twist",
    "nav_msgs/msg/Odometry": ".twist.twist",
}


class FoundSensor(NamedTuple):
    """A sensor as a file describes it."""

    text: str
    """Its name, or its condition."""
    said: str
    """What was heard of it, or what it means."""


class Ros2Survey:
    """Takes in what is said on topics; a `Readers` that reads nothing.

    Args:
        graph: What there is to listen to.
        options: With which; its sensors do not matter.

    Attributes:
        publishers: Of each topic, in order of their names.
        heard: What each signal said, in the order in which they came.
    """

    def __init__(self, graph: RosGraph, options: Ros2Options) -> None:
        found = sorted(graph.publishers().items())
        self.publishers: dict[str, list[Endpoint]] = {
            topic: each for topic, each in found if topic not in _OWN
        }
        self.options = options
        self.signals: tuple[str, ...] = ()
        self.heard: dict[str, Signal] = {}
        self.counts: defaultdict[str, int] = defaultdict(int)
        self._times: defaultdict[str, list[float]] = defaultdict(list)
        self._ranges: dict[str, int] = {}  # how many a scan has
        self._bits = set[str]()  # signals that are booleans
        self._lock = threading.Lock()

    def wants(self, name: str) -> bool:
        """Return whether a signal is wanted: any is."""
        return True

    def terms(self, topic: str) -> list[Term]:
        """Return the signals that are terms: none is."""
        return []

    def read(
        self, values: Mapping[str, object], topic: str = ""
    ) -> tuple[dict[str, bool | None], list[InvalidValueError]]:
        """Take in what signals say."""
        with self._lock:
            for name, value in values.items():
                if name not in self.heard and len(self.heard) == _SIGNALS:
                    continue
                self.heard.setdefault(name, Signal()).add(value, learned=True)
                if type(value) is bool:
                    self._bits.add(name)
        return {}, []

    def note(self, topic: str, message: object, at: float) -> None:
        """Take in that a message came, and how long the ranges of a scan are."""
        with self._lock:
            self.counts[topic] += 1
            if len(self._times[topic]) <= _PERIODS:
                self._times[topic].append(at)
            ranges = message.get("ranges") if isinstance(message, dict) else None
            if isinstance(ranges, np.ndarray):
                self._ranges[topic] = len(ranges)

    def period(self, topic: str) -> float:
        """Return the seconds between two messages in the mean; 0 if there are few."""
        gaps = self._gaps(topic)
        return float(np.mean(gaps)) if len(gaps) > 1 else 0.0

    def _gaps(self, topic: str) -> NDArray[np.float64]:
        return np.diff(np.sort(self._times[topic]))

    def fields(self, topic: str) -> Iterator[tuple[str, Signal]]:
        """Yield the signals of a topic that are no items of lists."""
        for name, signal in self.heard.items():
            rest = name.removeprefix(topic)
            if rest != name and rest[0] in ".[" and not _ITEM.search(rest):
                yield name, signal

    def sensors(self, topic: str) -> Iterator[FoundSensor]:
        """Yield the sensors that a topic gives."""
        if not self.counts[topic]:
            return
        kind = self.publishers[topic][0].type
        known = list(self._known(topic, kind))
        yield from known
        read = {each.text.split(" ")[0] for each in known}
        for name, signal in self.fields(topic):
            if name in self._bits:
                yield FoundSensor(name, f"was {signal.says()}")
            elif name not in read and not known and kind != ARRAY:
                yield from _of(name, signal)
        if period := self.period(topic):
            # As long as it waits between bursts; but one message may be late.
            usual = float(np.quantile(self._gaps(topic), _USUAL))
            span = max(_STALE * usual, _SHORTEST)
            text = f"{topic} heard within {span:.2g} s"
            yield FoundSensor(text, f"usually every {period:.2g} s")

    def _known(self, topic: str, kind: str) -> Iterator[FoundSensor]:
        """Yield what is known of a type of messages."""
        if kind == "sensor_msgs/msg/BatteryState":
            text = f"{topic}.percentage < 0.2, off > 0.25"
            yield FoundSensor(text, f"was {self._says(f'{topic}.percentage')}; of 1")
        elif kind == "sensor_msgs/msg/LaserScan":
            size = self._ranges.get(topic, 0)
            edges = [size * part // _SECTORS for part in range(_SECTORS + 1)]
            for low, high in pairwise(edges):
                if low < high:
                    text = f"min({topic}.ranges[{low}:{high}]) < 0.5, off > 0.6"
                    yield FoundSensor(text, "something within half a metre")
        elif kind in _SPEEDS:
            for part in ("linear.x", "angular.z"):
                name = f"{topic}{_SPEEDS[kind]}.{part}"
                said = f"was {self._says(name)}"
                yield FoundSensor(f"{name} > 0.01", said)
                yield FoundSensor(f"{name} < -0.01", said)
        elif kind == ARRAY:
            for name, signal in self.fields(topic):
                if name.endswith(".level"):
                    said = f"warns, or worse; was {signal.says()}"
                    yield FoundSensor(f"{name} > 0", said)

    def _says(self, name: str) -> str:
        signal = self.heard.get(name)
        return "nothing" if signal is None else signal.says()


def _of(name: str, signal: Signal) -> Iterator[FoundSensor]:
    """Yield the sensors of a signal of which nothing more is known."""
    said = f"was {signal.says()}"
    if signal.is_plain:
        if signal.says() == "0 to 1":
            yield FoundSensor(name, said)
        return  # what was one of these only may be any number
    cuts = list(signal.cuts(name, Wanted.bins))
    if not cuts:
        return  # it is text, only grows, or said one thing
    if isinstance(cuts[0], Choice):
        texts = [f"{name} {each.text}" for each in cuts]
        yield from (FoundSensor(text, said) for text in texts if is_condition(text))
    else:
        yield FoundSensor(name, f"{said}; is cut before the run begins")


class SurveyFeeder(Ros2Feeder):
    """Hears every topic of a survey."""

    def __init__(self, survey: Ros2Survey) -> None:
        self._survey = survey
        topics = tuple(survey.publishers)
        super().__init__(msgspec.structs.replace(survey.options, sensors=topics))

    def values(
        self, topic: str, message: object, *, several: bool = False
    ) -> dict[str, object]:
        """Return all that a message says."""
        self._survey.note(topic, message, time.monotonic())
        return dict(fields(topic, message))


class RclpySurveyFeeder(SurveyFeeder, RclpyFeeder):
    """Hears every topic of a survey through `rclpy`."""


_BEGIN = """\
# What `neurosnap ros2 discover` found {where}. Delete what is of no use, and then:
# neurosnap run THIS_FILE

[source]
kind = "ros2"
{through}
domain = {domain}
#stale_after = 5             # seconds; a topic that is silent for longer is unknown
sensors = [
{sensors}]

[source.tick]                # a tick whenever a reading has changed, or
min_interval = 0.1           # seconds
max_interval = 10.0

[supervision]
restart_on_error = true
"""


def ros2_file(survey: Ros2Survey) -> str:
    """Return the text of a file that describes a run on what a survey found."""
    lines = ""
    for topic, publishers in survey.publishers.items():
        found = list(survey.sensors(topic))
        if found:
            lines += f"    # {topic}: {publishers[0].type}\n"
        for text, said in found:
            comment = "".join(a if a.isprintable() else "?" for a in said)
            lines += f"    {_quoted(text)},  # {comment}\n"
    router = survey.options.router
    by_rclpy = survey.options.through == "rclpy"
    return _BEGIN.format(
        where="through rclpy" if by_rclpy else f"at {router}",
        through='through = "rclpy"' if by_rclpy else f"router = {_quoted(router)}",
        domain=survey.options.domain,
        sensors=lines,
    )


def _quoted(text: str) -> str:
    # JSON's texts are TOML's, except one letter.
    return msgspec.json.encode(text).decode().replace("\x7f", "\\u007f")
