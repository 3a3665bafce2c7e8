r"""The JSON format of readings, the same for all inputs.

A single reading, which replaces the latest of its sensor::

    {"sensor": "door", "on": true, "at": 1690000000.0}

A whole reading, which gets a tick of its own; what it does not name is unknown::

    {"bits": {"door": true, "motion": 0}, "at": 1690000000.0}
    {"bits": [1, 0]}

A value is true, false, 1, 0, or a word of `neurosnap.sources.meaning`; null where the
sensor does not know. On a key of one sensor's own it stands alone, or as
``{"on": true, "at": 1690000000.0}``. ``at`` is in seconds since the epoch, and may be
missing: then it is the time of arrival. Another field is refused: it might be a
misspelt one. What is no reading, or longer than `LIMIT`, is an `InvalidValueError`.
"""

from collections.abc import Sequence
from typing import TypeAlias, TypeVar

import msgspec

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.live_source import LiveSource, unknown
from neurosnap.sources.meaning import Reader

LIMIT = 1 << 20
"""Bytes of one object, at most."""
_Value: TypeAlias = bool | int | float | str | None
_T = TypeVar("_T")
_reader = Reader("reading")


class Reading(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One JSON object with the reading of one sensor or of all; `read` checks which."""

    sensor: str | None = None
    on: _Value | msgspec.UnsetType = msgspec.UNSET
    bits: list[_Value] | dict[str, _Value] | None = None
    at: float | None = None

    def in_order(self, sensors: Sequence[str]) -> tuple[bool | None, ...]:
        """Return what is read of each sensor; None if that is unknown.

        Raises:
            ShapeError: They come without names, and not one a sensor.
            InvalidValueError: A value is none.
        """
        if isinstance(self.bits, dict):
            return tuple(value(self.bits.get(name)) for name in sensors)
        bits = self.bits or []
        if len(bits) != len(sensors):
            raise ShapeError("bits", f"must be {len(sensors)}, one a sensor", len(bits))
        return tuple(map(value, bits))


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


def read_on(payload: bytes) -> tuple[bool | None, float | None]:
    """Return the reading of one sensor, sent on its own key, and its time, if any."""
    if payload.lstrip().startswith(b"{"):
        said = _decoded(_ons, payload, "{'on': value, 'at': seconds}")
        return value(said.on), said.at
    word = payload.decode(errors="replace").strip().strip('"')
    return value(word[:40]), None


def too_long() -> InvalidValueError:
    """Return the error of a reading longer than `LIMIT`."""
    return InvalidValueError("reading", f"must be up to {LIMIT} bytes", "more")


def value(said: object) -> bool | None:
    """Return what a sensor read; None if it does not know."""
    try:
        return _reader.read(said)
    except ValueError as error:
        raise InvalidValueError("reading", str(error), said) from None


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
    if said.sensor is not None:
        source.receive({said.sensor: value(said.on)}, said.at)
        return
    readings = said.in_order(source.sensors)
    named = said.bits if isinstance(said.bits, dict) else {}
    wrong = [unknown(name) for name in named if name not in source.sensors]
    source.receive_whole(readings, said.at, spare=spare, wrong=wrong)
