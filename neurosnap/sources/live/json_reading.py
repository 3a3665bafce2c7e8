r"""The JSON format of readings, the same for all inputs.

A single reading, which replaces the latest of its sensor::

    {"sensor": "door", "on": true, "at": 1690000000.0}

A whole reading, which gets a tick of its own; what it does not name is unknown::

    {"bits": {"door": true, "motion": 0}, "at": 1690000000.0}
    {"bits": [1, 0]}

A value is true, false, 1, 0, or a word of `neurosnap.sources.meaning`; null where the
sensor does not know; a number or a word where a condition reads it, and an object or a
list where one reads a field of it, ``arm.angle > 3``. On a key of one sensor's own it
stands alone, or as ``{"on": true, "at": 1690000000.0}``. ``at`` is in seconds since the
epoch, and may be missing: then it is the time of arrival. Another field is refused: it
might be a misspelt one. What is no reading, or longer than `LIMIT`, is an
`InvalidValueError`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, TypeVar

import msgspec

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.live_source import LiveSource, unknown
from neurosnap.sources.live.signal_readers import flattened

LIMIT = 1 << 20
"""Bytes of one object, at most."""
_Value: TypeAlias = Any
_T = TypeVar("_T")


class Reading(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One JSON object with the reading of one sensor or of all; `read` checks which."""

    sensor: str | None = None
    on: _Value | msgspec.UnsetType = msgspec.UNSET
    bits: list[_Value] | dict[str, _Value] | None = None
    at: float | None = None

    def values(self, signals: Sequence[str]) -> dict[str, object]:
        """Return what signals say.

        Raises:
            ShapeError: They come without names, and not one a signal.
        """
        if self.sensor is not None:
            return {self.sensor: self.on}
        if isinstance(self.bits, dict):
            return dict(self.bits)
        bits = self.bits or []
        if len(bits) != len(signals):
            raise ShapeError("bits", f"must be {len(signals)}, one a sensor", len(bits))
        return dict(zip(signals, bits, strict=True))


class _On(msgspec.Struct, forbid_unknown_fields=True):
    """What stands on a key of one sensor's own."""

    on: _Value
    at: float | None = None


_readings = msgspec.json.Decoder(Reading)
_ons = msgspec.json.Decoder(_On)


def read(payload: bytes) -> Reading:
    """Return the reading in one JSON object."""
    if len(payload) > LIMIT:
        raise too_long()
    said = _decoded(_readings, payload, "a reading in JSON")
    named = said.sensor is not None
    if named is (said.bits is not None) or named is (said.on is msgspec.UNSET):
        rule = "must have the fields sensor and on, or bits"
        raise InvalidValueError("reading", rule, payload[:40])
    return said


def read_on(payload: bytes) -> tuple[object, float | None]:
    """Return what one signal says, sent on its own key, and its time, if any."""
    if payload.lstrip().startswith(b"{"):
        said = _decoded(_ons, payload, "{'on': value, 'at': seconds}")
        return said.on, said.at
    return payload.decode(errors="replace").strip().strip('"')[:40], None


def too_long() -> InvalidValueError:
    """Return the error of a reading longer than `LIMIT`."""
    return InvalidValueError("reading", f"must be up to {LIMIT} bytes", "more")


def _decoded(decoder: msgspec.json.Decoder[_T], payload: bytes, what: str) -> _T:
    try:
        return decoder.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        rule = f"must be {what} ({error})"
        raise InvalidValueError("reading", rule, payload[:40]) from error


def hand_in(source: LiveSource, payload: bytes, *, spare: bool) -> None:
    """Give the reading in one JSON object to a source.

    Args:
        source: Takes it.
        payload: The object, as `neurosnap.sources.live.json_reading` has it.
        spare: Do not drop a whole reading while too many wait; see
            `LiveSource.receive_whole`.
    """
    said = read(payload)
    values = said.values(source.readers.signals)
    readings = readings_in(source, values)
    strange = [unknown(name) for name in values if not source.readers.wants(name)]
    if said.sensor is not None:
        source.receive(readings, said.at, strange)
        return
    bits = [readings.get(name) for name in source.sensors]
    source.receive_whole(bits, said.at, spare=spare, wrong=strange)


def readings_in(
    source: LiveSource, values: Mapping[str, object]
) -> dict[str, bool | None]:
    """Return what sensors read, by what signals say.

    Raises:
        InvalidValueError: A signal says what is no reading.
    """
    readings, wrong = source.readers.read(flattened(values, source.readers))
    if wrong:
        raise wrong[0]
    return readings
