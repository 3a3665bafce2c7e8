"""Opens a live source by its name and arguments.

``-`` is standard input, ``zenoh:`` the keys of the swarm itself, ``mqtt:`` a broker's
topics. Opening starts nothing: a run opens its source twice, once to learn the sensors'
names, once to be the world.
"""

from collections.abc import Mapping
from typing import Annotated, TypeAlias

import msgspec

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_readings import LatestReadings
from neurosnap.sources.live.live_source import Feeder, LiveSource
from neurosnap.sources.live.statistics import Statistics
from neurosnap.sources.live.stdin_source import StdinFeeder, first_line, names_in
from neurosnap.sources.live.tick_schedule import TickSchedule, new_schedule
from neurosnap.sources.live.zenoh_source import Hub, ZenohFeeder
from neurosnap.sources.mqtt.options import MqttOptions
from neurosnap.system.distribution import must_have

STDIN = "-"
ZENOH = "zenoh:"
MQTT = "mqtt:"

Argument: TypeAlias = bool | int | float | str
"""What may be given to a source by name."""
Seconds: TypeAlias = Annotated[float, msgspec.Meta(gt=0)]


class LiveArguments(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What an outside source is opened with."""

    sensors: str = ""
    """The names, in order, commas between them, or as a JSON list."""
    stale_after: Seconds | None = None
    """Seconds after which a reading is believed no more; None: it always is."""
    interval: Seconds | None = None
    """Seconds between two ticks; None: a tick as soon as something changed."""
    min_interval: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """Without `interval`: seconds between two ticks at least."""
    max_interval: Seconds | None = None
    """Without `interval`: seconds between two ticks at most."""
    head: str = ""
    """The first line of standard input, where it was read to learn the names."""

    def names(self) -> tuple[str, ...]:
        """Return the sensors' names.

        Raises:
            InvalidValueError: It is no list of texts.
        """
        if not self.sensors.startswith("["):
            return tuple(name.strip() for name in self.sensors.split(","))
        try:
            return msgspec.json.decode(self.sensors, type=tuple[str, ...])
        except msgspec.MsgspecError as error:
            rule = f"must be names with commas between them, or a JSON list ({error})"
            raise InvalidValueError("sensors", rule, self.sensors) from error

    def schedule(self) -> TickSchedule:
        """Return when a tick is due.

        Raises:
            InvalidValueError: The intervals do not go together.
        """
        return new_schedule(self.interval, self.min_interval, self.max_interval)


def is_live(spec: str) -> bool:
    """Tell whether `spec` is the name of a source that `open_live` opens."""
    return spec in (STDIN, ZENOH, MQTT)


def settle(spec: str, arguments: Mapping[str, Argument]) -> dict[str, Argument]:
    """Return the arguments with the sensors' names in them, once and for all.

    Standard input can be read once only, so whoever starts a run calls this first and
    lets everybody open the source with what it returns.

    Args:
        spec: As for `open_live`.
        arguments: As for `open_live`. Without `sensors` the first line of standard
            input says them; this waits for it.

    Raises:
        InvalidValueError: The first line names no sensors, or an argument is wrong.
    """
    if spec != STDIN:
        return dict(arguments)
    given = _converted(arguments)
    if given.sensors:
        return dict(arguments)
    line = first_line()
    names = msgspec.json.encode(names_in(line)).decode()
    return {**arguments, "sensors": names, "head": line.decode()}


def open_live(
    spec: str,
    arguments: Mapping[str, Argument] | None = None,
    hub: Hub | None = None,
    *,
    journal: Journal | None = None,
    most: int | None = None,
) -> LiveSource:
    """Return the source called `spec`; nothing is started before its first tick.

    Args:
        spec: ``-``, ``zenoh:`` or ``mqtt:``.
        arguments: As `LiveArguments` has them; `sensors` must be among them. For
            ``mqtt:`` one alone, `options`: `MqttOptions` as JSON, as a file of ours
            has it in its table `[source]`.
        hub: The swarm's; None: for a look only, ``zenoh:`` cannot be started.
        journal: As for `LiveSource`.
        most: As for `LiveSource`.

    Raises:
        InvalidValueError: There is no such source, or an argument is wrong.

    Example:
        >>> source = open_live("-", {"sensors": "door,motion", "stale_after": 60})
        >>> source.sensors, source.live
        (('door', 'motion'), True)
        >>> source.close()
    """
    if not is_live(spec):
        rule = f"must be {STDIN}, {ZENOH} or {MQTT}"
        raise InvalidValueError("source", rule, spec)
    arguments = {} if arguments is None else arguments
    if spec == MQTT:
        return _open_mqtt(mqtt_options(arguments), journal, most)
    given = _converted(arguments)
    if not given.sensors:
        rule = "must be named for such a source (--set sensors=a,b,c)"
        raise InvalidValueError("sensors", rule, given.sensors)
    latest = LatestReadings(given.names(), stale_after=given.stale_after)
    schedule = given.schedule()
    feeder: Feeder
    if spec == STDIN:
        feeder = StdinFeeder(head=given.head.encode() if given.head else None)
    else:
        feeder = _Nobody() if hub is None else ZenohFeeder(hub)
    return LiveSource(latest, schedule, feeder=feeder, journal=journal, most=most)


def lost_by(spec: str, said: Statistics) -> int:
    """Return how much of what a source was given is lost: it had no tick.

    What standard input says is meant for the run, so a line that is no reading is lost.
    On a broker and on a hub others may say what they like.
    """
    refused = said.refused if spec == STDIN else 0
    return said.dropped + said.missing + refused


def mqtt_options(arguments: Mapping[str, Argument]) -> MqttOptions:
    """Return the options that the arguments of an ``mqtt:`` source hold.

    Raises:
        InvalidValueError: They hold none, or wrong ones.
    """
    try:
        return msgspec.json.decode(str(arguments["options"]), type=MqttOptions)
    except (KeyError, msgspec.MsgspecError) as error:
        rule = "must hold the options of an MQTT source: name a file that describes one"
        raise InvalidValueError("arguments", rule, str(error)) from error


def _open_mqtt(
    options: MqttOptions, journal: Journal | None, most: int | None
) -> LiveSource:
    try:
        from neurosnap.sources.mqtt.mqtt_source import mqtt_source
    except ImportError as error:  # an extra
        rule = must_have(error.name or "aiomqtt", "mqtt")
        raise InvalidValueError("source", rule, MQTT) from error
    return mqtt_source(options, journal=journal, most=most)


class _Nobody:
    """Feeds a source that is only looked at."""

    def start(self, source: LiveSource) -> None:
        """Say that there is no hub to listen to."""
        rule = "must be a swarm's with a hub, cells in processes"
        source.fail(NeurosnapError(f"source: {rule}, got {ZENOH!r}"))

    def stop(self) -> None:
        """Nothing was started."""


def _converted(arguments: Mapping[str, Argument]) -> LiveArguments:
    try:
        return msgspec.convert(dict(arguments), LiveArguments)
    except msgspec.ValidationError as error:
        rule = f"must be ones such a source takes ({error})"
        raise InvalidValueError("arguments", rule, dict(arguments)) from error
