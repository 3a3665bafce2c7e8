"""Readings of the world's own sensors in a recorded run, and the alarms they raise."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.health.alarm import News
from neurosnap.health.alarm_budget import NEVER
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import Sensorium, unpack_readings
from neurosnap.sources.readings import Readings, utc

_SECOND = 1e9


class OwnReadings(NamedTuple):
    """What the world's own sensors read at one tick."""

    at: float
    """When it was, seconds since 1970."""
    on: NDArray[np.bool_]
    """``(n,)``, which are on."""
    known: NDArray[np.bool_]
    """``(n,)``, which readings are known."""
    begins: bool = False
    """Readings before it were missed."""
    said: bytes = b""
    """The numbers behind them, as in `wire.Observation`."""


def own_readings(message: wire.Observation, sent: int, body: Body) -> OwnReadings:
    """Return what a message says.

    Args:
        message: Of a run with that body.
        sent: Nanoseconds since 1970; stands in where it does not say when it was.
        body: What is sensed.

    Raises:
        ShapeError: It is of another number of sensors.
    """
    own = len(body.own)
    bits, known = unpack_readings(message.bits, message.known, body.count)
    told = np.ones(own, np.bool_) if known is None else known[:own]
    at = message.at or sent / _SECOND
    return OwnReadings(at, bits[:own], told, message.begins, message.said)


def observations(recording: Recording) -> Iterator[tuple[int, OwnReadings]]:
    """Yield the readings of a recorded run, each after its tick.

    Raises:
        RecordingError: While iterating: the recording is damaged, or not a run's.
    """
    body = recording.options.body
    for message, _, _, sent, _ in recording.messages(("observation",)):
        if isinstance(message, wire.Observation):
            yield message.tick, own_readings(message, sent, body)


def alarms_of(recording: Recording, by: RunOptions) -> Iterator[tuple[int, News]]:
    """Yield the alarms of a run by some options, and their ends, each after its tick.

    Raises:
        RecordingError: While iterating: the recording is damaged, or not a run's.
    """
    if by.alarms == NEVER:
        return
    follower = by.follower()
    for tick, (at, on, known, begins, said) in observations(recording):
        for each in follower.observe(on, known, at, begins=begins, said=said):
            yield tick, each


def readings_of(recording: Recording, sensorium: Sensorium, last: int) -> Readings:
    """Return the readings a run learned from, tick for tick, as a table.

    What is not there is unknown.

    Args:
        recording: A run's.
        sensorium: What its sensors are called by then.
        last: The last tick to read.

    Raises:
        RecordingError: The recording is damaged.
    """
    count = recording.options.body.count
    growing, times = GrowingColumns(sensorium), list[str]()

    def skip_to(tick: int) -> None:
        missing = tick - growing.ticks
        nothing = np.zeros((missing, count), np.bool_)
        growing.extend(nothing, nothing)
        times.extend([""] * missing)

    for message, _, _, _, log_time in recording.messages(("observation",)):
        if not isinstance(message, wire.Observation):
            continue
        if growing.ticks < message.tick <= last:
            skip_to(message.tick - 1)
            bits, known = unpack_readings(message.bits, message.known, count)
            growing.append(bits, known)
            times.append(utc(log_time / _SECOND))
    skip_to(last)
    return Readings(growing.columns(), times)
