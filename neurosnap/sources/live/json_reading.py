r"""The JSON object in which programs send readings, on every way in.

A single reading, which replaces the latest of its sensor::

    {"sensor": "door", "on": true, "at": 1690000000.0}

A whole reading, which gets a tick of its own; what it does not name is unknown::

    {"bits": {"door": true, "motion": 0}, "at": 1690000000.0}
    {"tick": 12, "bits": [1, 0]}

The names, where they are not given to the run; before everything else::

    {"sensors": ["door", "motion"]}

A value is true, false, 1, 0, ``"on"``, ``"off"``, ``"true"``, ``"false"``, ``"1"`` or
``"0"``, in capitals or not; null where the sensor does not know. On a key of one
sensor's own it stands alone, or as ``{"on": true, "at": 1690000000.0}``. ``at`` is in
seconds since the epoch, and may be missing: then it is the time of arrival. ``tick`` is
the program's own number, for people who read along; nothing depends on it. Another
field is refused: it might be a misspelt one.
"""

from collections.abc import Sequence
from typing import TypeAlias, TypeVar

import msgspec

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.live_source import LiveSource

LIMIT = 1 << 20
"""Bytes of one object, at most."""

_WORDS = {"on": True, "true": True, "1": True, "off": False, "false": False, "0": False}
_Value: TypeAlias = bool | int | str | None
_UNSET = msgspec.UNSET
_T = TypeVar("_T")


class Reading(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One object: of a single sensor, of all sensors, or of their names.

    Which fields go together is checked by `read`; `value` says what a value means.
    """

    sensor: str | msgspec.UnsetType = _UNSET
    on: _Value | msgspec.UnsetType = _UNSET
    bits: list[_Value] | dict[str, _Value] | msgspec.UnsetType = _UNSET
    at: float | msgspec.UnsetType | None = _UNSET
    tick: int | msgspec.UnsetType | None = _UNSET
    sensors: tuple[str, ...] | msgspec.UnsetType = _UNSET

    @property
    def time(self) -> float | None:
        """When it was read; None if it does not say so."""
        return None if self.at is _UNSET else self.at

    def in_order(self, sensors: Sequence[str]) -> tuple[bool | None, ...]:
        """Return what is read of each sensor; None if that is unknown.

        Raises:
            ShapeError: They come without names, and not one a sensor.
            InvalidValueError: A value is none.
        """
        if isinstance(self.bits, dict):
            return tuple(value(self.bits.get(name)) for name in sensors)
        bits = [] if self.bits is _UNSET else self.bits
        if len(bits) != len(sensors):
            rule = f"must be {len(sensors)}, one a sensor"
            raise ShapeError("bits", rule, len(bits))
        return tuple(map(value, bits))


_SHAPES: tuple[tuple[set[str], set[str]], ...] = (
    ({"sensor", "on"}, {"at"}),
    ({"bits"}, {"at", "tick"}),
    ({"sensors"}, set()),
)
"""Fields that must be there, and that may be."""


class _On(msgspec.Struct, forbid_unknown_fields=True):
    """What stands on a key of one sensor's own."""

    on: _Value
    at: float | None = None


_readings = msgspec.json.Decoder(Reading)
_ons = msgspec.json.Decoder(_On)


def read(payload: bytes) -> Reading:
    """Return what is said in one JSON object.

    Raises:
        InvalidValueError: It is none, is longer than `LIMIT`, or has fields that do not
            go together.
    """
    if len(payload) > LIMIT:
        raise too_long()
    said = _decoded(_readings, payload, "a reading in JSON")
    fields = {
        name for name in said.__struct_fields__ if getattr(said, name) is not _UNSET
    }
    if not any(must <= fields <= must | may for must, may in _SHAPES):
        rule = "must have the fields sensor and on, or bits, or sensors"
        raise InvalidValueError("reading", rule, sorted(fields))
    return said


def read_on(payload: bytes) -> tuple[bool | None, float | None]:
    """Return what is said of one sensor, on a key of its own, and its time, if any.

    Raises:
        InvalidValueError: It is no value, or an object without one or with more.
    """
    if payload.lstrip().startswith(b"{"):
        said = _decoded(_ons, payload, "{'on': value, 'at': seconds}")
        return value(said.on), said.at
    word = payload.decode(errors="replace").strip().strip('"')
    return (None if word.lower() == "null" else value(word[:40])), None


def too_long() -> InvalidValueError:
    """Return the error of a reading longer than `LIMIT`."""
    return InvalidValueError("reading", f"must be up to {LIMIT} bytes", "more")


def value(said: object) -> bool | None:
    """Return what a sensor read; None if it does not know.

    Raises:
        InvalidValueError: `said` is no such value.
    """
    if said is None:
        return None
    if isinstance(said, str):
        found = _WORDS.get(said.strip().lower())
    else:
        found = said == 1 if isinstance(said, int) and said in (0, 1) else None
    if found is None:
        rule = "must be true, false, 1, 0, on, off or null"
        raise InvalidValueError("reading", rule, said)
    return found


def _decoded(decoder: msgspec.json.Decoder[_T], payload: bytes, what: str) -> _T:
    try:
        return decoder.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        rule = f"must be {what} ({error})"
        raise InvalidValueError("reading", rule, payload[:40]) from error


def hand_in(source: LiveSource, payload: bytes, *, spare: bool) -> None:
    """Hand in what one JSON object says.

    Args:
        source: Takes it.
        payload: The object, as `neurosnap.sources.live.json_reading` has it.
        spare: Do not drop a whole reading while too many wait; see
            `LiveSource.receive_whole`.

    Raises:
        InvalidValueError: It is no reading, or none of this source.
    """
    said = read(payload)
    if said.sensor is not _UNSET:
        source.receive(said.sensor, value(said.on), said.time)
    elif said.sensors is not _UNSET:
        if said.sensors != source.sensors:
            rule = "must be those the run began with"
            raise InvalidValueError("sensors", rule, said.sensors)
    else:
        readings = said.in_order(source.sensors)
        named = said.bits if isinstance(said.bits, dict) else {}
        for name in named.keys() - set(source.sensors):
            source.receive(name, None)
        source.receive_whole(readings, said.time, spare=spare)
