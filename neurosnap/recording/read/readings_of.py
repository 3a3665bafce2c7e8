"""What the sensors of a recorded run read, as a table."""

import numpy as np

from neurosnap import wire
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.protocol.observations import readings
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of
from neurosnap.sensorium import Sensorium
from neurosnap.sources.tables.readings import Readings, utc

_SECOND = 1e9


def readings_of(recording: Recording, sensorium: Sensorium, last: int) -> Readings:
    """Return the readings a run learned from, tick for tick.

    What is not there is unknown, and so is what came while learning was paused.

    Args:
        recording: A run's.
        sensorium: What its sensors are called by then.
        last: The last tick to read.

    Raises:
        RecordingError: The recording is damaged.
    """
    count = options_of(recording).body.count
    growing, times = GrowingColumns(sensorium), list[str]()

    def skip_to(tick: int) -> None:
        missing = tick - growing.ticks
        nothing = np.zeros((missing, count), np.bool_)
        growing.extend(nothing, nothing)
        times.extend([""] * missing)

    for message, _, _, _, log_time in recording.messages(("observe",)):
        if not isinstance(message, wire.Observation):
            continue
        if growing.ticks < message.tick <= last:
            skip_to(message.tick - 1)
            bits, known = readings(message, count)
            growing.append(bits, np.zeros_like(bits) if message.paused else known)
            times.append(utc(log_time / _SECOND))
    skip_to(last)
    return Readings(growing.columns(), times)
