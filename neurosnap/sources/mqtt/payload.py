"""Converts MQTT payloads to on, off or unknown.

A reading that breaks a rule changes nothing: an error says what was wrong, and the
sensor keeps what it had until that is stale.
"""

from functools import cached_property
from typing import Any

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import UNKNOWN
from neurosnap.sources.meaning import Reader
from neurosnap.sources.mqtt.options import MqttSensor

LARGEST = 64 * 1024
"""Bytes of a payload that are looked at; one that is longer is refused unread."""
_SHOWN = 40  # characters of a payload in an error


class Payload:
    """A published payload, decoded once for all sensors that read it."""

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
    """Reads the payloads of one sensor's topic: on, off or unknown."""

    def __init__(self, sensor: MqttSensor) -> None:
        self._sensor = sensor
        words: dict[str, bool | None] = dict.fromkeys(UNKNOWN)
        words |= {word.casefold(): True for word in sensor.on}
        words |= {word.casefold(): False for word in sensor.off}
        self.reader = Reader(sensor.name, sensor.condition, words)

    def value(self, payload: Payload) -> object:
        """Return what `payload` says of the sensor; raises as `read`."""
        field = self._sensor.field
        return payload.text if field is None else payload.field(field)

    def read(self, payload: Payload) -> bool | None:
        """Return whether `payload` says on or off; None if it says unknown.

        Raises:
            InvalidValueError: It says neither; the text has the topic and the first 40
                characters.
        """
        sensor = self._sensor
        if sensor.heard_within is not None:
            return True
        value = self.value(payload)
        try:
            return self.reader.read(value)
        except ValueError as error:
            place = sensor.field or "payload"
            raise payload.wrong(f"{place} {error}") from None
