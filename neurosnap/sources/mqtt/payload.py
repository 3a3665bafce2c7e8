"""Converts MQTT payloads to on, off or unknown.

A reading that breaks a rule changes nothing: an error says what was wrong, and the
sensor keeps what it had until that is stale.
"""

import math
from functools import cached_property
from typing import Any

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.latest_readings import REMEMBERED
from neurosnap.sources.meaning import UNKNOWN
from neurosnap.sources.mqtt.options import MqttSensor

LARGEST = 64 * 1024
"""Bytes of a payload that are looked at; one that is longer is refused unread."""

_SHOWN = 40  # characters of a payload in an error


class Payload:
    """What was published, decoded once however many sensors read it, if it can be.

    Args:
        topic: Where to.
        data: What.
    """

    def __init__(self, topic: str, data: bytes) -> None:
        self.topic = topic
        self.data = data

    @cached_property
    def text(self) -> str:
        """The payload as text, without white space at its ends.

        Raises:
            InvalidValueError: It is too long, or no UTF-8.
        """
        if len(self.data) > LARGEST:
            rule = f"must be at most {LARGEST} bytes long"
            raise InvalidValueError(self.topic, rule, len(self.data))
        try:
            return self.data.decode().strip()
        except UnicodeDecodeError as error:
            raise self.wrong("must be UTF-8 text") from error

    @cached_property
    def document(self) -> Any:  # noqa: ANN401 - JSON holds anything
        """The payload as JSON.

        Raises:
            InvalidValueError: It is none.
        """
        text = self.text
        try:
            return msgspec.json.decode(text)
        except (msgspec.MsgspecError, RecursionError) as error:
            raise self.wrong("must be JSON") from error

    def field(self, path: str) -> Any:  # noqa: ANN401 - JSON holds anything
        """Return what a JSON payload holds at `path`.

        Raises:
            InvalidValueError: It is no JSON, or has no such field.
        """
        here = self.document
        for step in path.split("."):
            match here:
                case dict() if step in here:
                    here = here[step]
                case list() if step.isdecimal() and int(step) < len(here):
                    here = here[int(step)]
                case _:
                    raise self.wrong(f"must have the field {path}")
        return here

    def wrong(self, rule: str) -> InvalidValueError:
        """Return the error that says so, with the payload's beginning."""
        shown = self.data[: 4 * _SHOWN].decode(errors="replace")[:_SHOWN]
        return InvalidValueError(self.topic, rule, shown)


class PayloadReader:
    """One sensor's reading of payloads; remembers its last comparisons, if any.

    Where topics combine, each has a last comparison of its own.

    Args:
        sensor: Which, and how it reads.
    """

    def __init__(self, sensor: MqttSensor) -> None:
        self._sensor = sensor
        self._comparison = sensor.comparison
        self._words: dict[str, bool | None] = dict.fromkeys(UNKNOWN)
        self._words |= {word.casefold(): True for word in sensor.on}
        self._words |= {word.casefold(): False for word in sensor.off}
        self._compared: dict[str, bool] = {}

    def read(self, payload: Payload) -> bool | None:
        """Return whether `payload` says on or off; None if it says unknown.

        Raises:
            InvalidValueError: It says neither; the text has the topic and the first 40
                characters.
        """
        if self._sensor.seen_within is not None:
            return True
        if self._sensor.field is None:
            value: Any = payload.text
        else:
            value = payload.field(self._sensor.field)
        if self._comparison is None:
            return self._word(payload, value)
        topic = "" if self._sensor.combines == "last" else payload.topic
        compared = None  # nothing to hold on to
        if not _is_unknown(value):
            number = _number(payload, value)
            compared = self._comparison.is_on(number, self._compared.get(topic))
        self._compared.pop(topic, None)
        if compared is not None:
            self._compared[topic] = compared
        if len(self._compared) > REMEMBERED:
            del self._compared[next(iter(self._compared))]
        return compared

    def _word(self, payload: Payload, value: object) -> bool | None:
        try:
            return self._words[_as_word(value)]
        except KeyError:
            words = ", ".join((*self._sensor.on, *self._sensor.off))
            place = self._sensor.field or "payload"
            raise payload.wrong(f"{place} must be one of {words}") from None


def _is_unknown(value: object) -> bool:
    """Tell whether a value says that nothing is known."""
    return value is None or (isinstance(value, str) and value.casefold() in UNKNOWN)


def _as_word(value: object) -> str:
    """Return the JSON value `value` as the word it would be in a plain payload."""
    match value:
        case str():
            return value.strip().casefold()
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float() if value.is_integer():
            return str(int(value))
        case _:
            return msgspec.json.encode(value).decode()


def _number(payload: Payload, value: object) -> float:
    """Return a JSON number, or text that is one.

    Raises:
        InvalidValueError: It is none, or not finite.
    """
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        try:
            number = float(value)
        except (ValueError, OverflowError):
            number = math.nan
        if math.isfinite(number):
            return number
    raise payload.wrong("must be a finite number")
