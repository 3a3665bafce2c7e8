"""The options of an MQTT source; stored in the recording, without secrets.

The password is named by where it is found, a file or a variable of the environment, and
is read where a connection is made. Nothing here connects, or needs the library that
does: a recording is read without it.
"""

import os
from pathlib import Path
from typing import Annotated

import msgspec

from neurosnap.errors import InvalidValueError, within
from neurosnap.sensorium import OFF, ON, Sensorium
from neurosnap.sources.conditions import Condition, Heard, parse_condition
from neurosnap.sources.live.tick_schedule import Seconds, TickRule

Text = Annotated[str, msgspec.Meta(min_length=1, max_length=1024)]
_TOPIC = "must be a topic, without + and #"


class MqttBroker(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The address of the broker, and the connection's options."""

    host: Text = "localhost"
    """Its name or address."""
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] | None = None
    """Its port; if None, 8883 with TLS and 1883 without."""
    tls: bool = False
    """Whether the connection is encrypted and the broker's certificate checked. Without
    it a password crosses the network in the clear."""
    ca_file: Text | None = None
    """PEM certificates to trust instead of the system's; only with TLS."""
    username: Text | None = None
    """Who connects; None if the broker does not ask."""
    password_file: Text | None = None
    """A file whose first line is the password."""
    password_env: Text | None = None
    """A variable of the environment that holds it."""
    patience: Seconds = 10.0
    """Seconds a start may take until it is connected; afterwards there is no limit."""

    def __post_init__(self) -> None:
        try:
            self.host.encode("idna")
        except UnicodeError:
            rule = "must be a name or an address"
            raise InvalidValueError("host", rule, self.host) from None
        if self.ca_file is not None and not self.tls:
            raise InvalidValueError("ca_file", "must go with tls", self.ca_file)
        if self.password_file is not None and self.password_env is not None:
            rule = "must not go with password_file: one place is enough"
            raise InvalidValueError("password_env", rule, self.password_env)
        place = self.password_file or self.password_env
        if place is not None and self.username is None:
            raise InvalidValueError("username", "must go with a password", None)

    @property
    def address(self) -> str:
        """Host and port, for people."""
        return f"{self.host}:{self.resolved_port}"

    @property
    def resolved_port(self) -> int:
        """The port, whether given or not."""
        if self.port is not None:
            return self.port
        return 8883 if self.tls else 1883

    def password(self) -> str | None:
        """Return the password from where it is kept; None if there is none.

        Raises:
            InvalidValueError: It is not there. The text names the place, never what was
                found in it.
        """
        if self.password_env is not None:
            secret = os.environ.get(self.password_env, "")
            if not secret:
                rule = "must be set in the environment"
                raise InvalidValueError("password_env", rule, self.password_env)
            return secret
        if self.password_file is None:
            return None
        try:
            lines = Path(self.password_file).read_text("utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            # The text of a decoding error would quote what it could not decode.
            cause = error.strerror if isinstance(error, OSError) else "no UTF-8 text"
            rule = f"must be a file that can be read ({cause})"
            raise InvalidValueError("password_file", rule, self.password_file) from None
        if not lines or not lines[0]:
            rule = "must hold the password in its first line"
            raise InvalidValueError("password_file", rule, self.password_file)
        return lines[0]


class MqttSensor(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A sensor, and how it reads what is published.

    It reads words, or compares numbers, or notices that anything is published at all.
    """

    name: Text
    """The sensor's name."""
    topic: Text
    """Where from."""
    field: Text | None = None
    """The way to a field of a JSON payload, levels apart by dots, places in a list by
    number (``climate.0.value``); None if the whole payload is meant."""
    on: tuple[Text, ...] = ON
    """Words that mean on, whatever their case."""
    off: tuple[Text, ...] = OFF
    """Words that mean off."""
    when: Text | None = None
    """When it is on: ``> 22``, or ``> 22 °C, off < 21``: off only below 21, and between
    the two, both included, as it was before; ``= warm``; ``changes``, ``rises`` or
    ``falls``; or ``heard within 60 s`` of any message, but for one that the broker
    kept, which may be old. If None, it reads words."""
    bins: Annotated[int, msgspec.Meta(ge=2)] | None = None
    """Parts that the range of its number is cut into: it becomes as many sensors less
    one, by what it says before the run begins. If None, it is one sensor."""
    stale_after: Seconds | None = None
    """Seconds after which a reading no longer counts; if None, the source's own."""

    def __post_init__(self) -> None:
        if not is_topic(self.topic):
            raise InvalidValueError(f"{self.name}: topic", _TOPIC, self.topic)
        try:
            heard = self.heard_within is not None
        except InvalidValueError as error:
            raise within(self.name, error) from None
        if self.bins is not None and self.when is not None:
            rule = "must not go with when, which says where it is cut"
            raise InvalidValueError(f"{self.name}: bins", rule, self.bins)
        if heard and self.field is not None:
            rule = "must not go with heard within, which does not look inside"
            raise InvalidValueError(f"{self.name}: field", rule, self.field)
        both = {word.casefold() for word in self.on} & {
            word.casefold() for word in self.off
        }
        if both:
            rule = "must differ from the words for on"
            raise InvalidValueError(f"{self.name}: off", rule, sorted(both))

    @property
    def condition(self) -> Condition | None:
        """When it is on; None if it reads words."""
        signal = f"{self.topic} {self.field or ''}"
        return None if self.when is None else parse_condition(self.when, signal)

    @property
    def heard_within(self) -> float | None:
        """Seconds after a message in which it is on; None: it reads what that says."""
        condition = self.condition
        return condition.within if isinstance(condition, Heard) else None


class MqttAction(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An action, and what is published when it is taken.

    That is sent until the broker has it, so it may come twice.
    """

    name: Text
    """The action's name."""
    topic: Text
    """Where to."""
    payload: Annotated[str, msgspec.Meta(max_length=65536)] = "ON"
    """What."""
    retain: bool = False
    """Whether the broker keeps it for those who come later."""

    def __post_init__(self) -> None:
        if not is_topic(self.topic):
            raise InvalidValueError(f"{self.name}: topic", _TOPIC, self.topic)


class MqttTick(TickRule, frozen=True):
    """When a tick happens: by the clock, or on change."""

    min_interval: Annotated[float, msgspec.Meta(ge=0, le=31_536_000)] = 0.1
    """Without `interval`: seconds between two ticks at least."""


class MqttPublish(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """What is published of the run itself."""

    prefix: Text = "neurosnap"
    """What all its topics start with."""
    discovery: bool = True
    """Whether Home Assistant is told, so that it shows everything by itself."""
    discovery_prefix: Text = "homeassistant"
    """Where Home Assistant listens."""
    device: Text = "neurosnap"
    """What the run is called there."""

    def __post_init__(self) -> None:
        for name in ("prefix", "discovery_prefix"):
            given = getattr(self, name)
            if not is_topic(given):
                raise InvalidValueError(name, _TOPIC, given)


class MqttOptions(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="mqtt",
):
    """The options of an MQTT source: sensors and actions by topics."""

    broker: MqttBroker = MqttBroker()
    """Where everything goes through."""
    sensors: Annotated[tuple[MqttSensor, ...], msgspec.Meta(min_length=1)]
    """The sensors, in order."""
    actions: tuple[MqttAction, ...] = ()
    """The actions, one of which is taken at every tick, or ``none``."""
    stale_after: Seconds | None = None
    """Seconds after which a reading no longer counts and the sensor is unknown; None:
    a reading counts until the next one."""
    stretch: Seconds = 600.0
    """Seconds in which the ranges of numbers are learned first, where `bins` asks."""
    tick: MqttTick = MqttTick()
    """When a tick happens."""
    publish: MqttPublish | None = None
    """What is published of the run; if None, nothing but actions."""

    def __post_init__(self) -> None:
        Sensorium([sensor.name for sensor in self.sensors])
        if self.actions:
            Sensorium(self.action_names)

    @property
    def action_names(self) -> tuple[str, ...]:
        """The actions' names, doing nothing first; none if there are none."""
        if not self.actions:
            return ()
        return ("none", *(action.name for action in self.actions))


def conditions_of(options: MqttOptions) -> dict[str, Condition]:
    """Return when sensors are on, by name; those of one signal have one source."""
    return {
        sensor.name: condition
        for sensor in options.sensors
        if (condition := sensor.condition)
    }


def with_cuts_of(options: MqttOptions, run: MqttOptions) -> MqttOptions:
    """Return options whose numbers are cut as they were in a run."""
    sensors: list[MqttSensor] = []
    for sensor in options.sensors:
        where = sensor.topic, sensor.field
        sensors += (
            [sensor]
            if sensor.bins is None
            else (
                msgspec.structs.replace(
                    sensor, name=each.name, when=each.when, bins=None
                )
                for each in run.sensors
                if (each.topic, each.field) == where
                and each.name.startswith(sensor.name)
            )
        )
    return msgspec.structs.replace(options, sensors=tuple(sensors) or options.sensors)


def is_topic(topic: str) -> bool:
    """Whether `topic` is one topic, with no wildcards."""
    size = len(topic.encode("utf-8", "replace"))
    return 0 < size < 65536 and not {"\0", "+", "#"} & set(topic)
