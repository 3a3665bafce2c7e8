"""Applies a JSON reading to a live source."""

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.json_reading import Names, Single, read
from neurosnap.sources.live.live_source import LiveSource


def hand_in(source: LiveSource, payload: bytes, *, spare: bool) -> None:
    """Hand in what one JSON object says.

    Args:
        source: Takes it.
        payload: The object, as `neurosnap.sources.live.json_reading` has it.
        spare: Do not drop a whole reading while too many wait; see
            `LiveSource.give`.

    Raises:
        InvalidValueError: It is no reading, or none of this source.
    """
    reading = read(payload)
    if isinstance(reading, Single):
        source.put(reading.sensor, reading.on, reading.at)
    elif isinstance(reading, Names):
        if reading.sensors != source.sensors:
            rule = "must be those the run began with"
            raise InvalidValueError("sensors", rule, reading.sensors)
    else:
        for name in reading.strangers(source.sensors):
            source.put(name, None)
        source.give(reading.in_order(source.sensors), reading.at, spare=spare)
