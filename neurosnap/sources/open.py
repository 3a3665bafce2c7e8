"""Opens a source by its name; a new kind of source is added here.

A name is the path of a file of readings, the id of a Gymnasium environment, or that of
a live source: ``-`` is standard input, ``zenoh:`` the keys of the swarm itself,
``mqtt:`` a broker's topics, ``ros2:`` those of robots.

After k steps a source returns a function of its name, the seed and the actions only;
live sources cannot: they cannot be brought back to where they were. `open_source`
checks whatever can be checked first: a file with a bad row 900 is refused before
anything is started, not at tick 900.

Opening a live source starts nothing: a run opens it twice, once to learn the sensors'
names, once to be the world.
"""

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import visible
from neurosnap.sources.conditions import Signals, parse_span
from neurosnap.sources.cuts import as_json, conditions_in, recorded_signals
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import Feeder, LiveSource
from neurosnap.sources.live.signal_readers import SignalReaders, signals_of
from neurosnap.sources.live.statistics import Statistics
from neurosnap.sources.live.stdin_source import StdinFeeder, first_lines
from neurosnap.sources.live.tick_schedule import Seconds, TickRule
from neurosnap.sources.live.zenoh_source import Hub, ZenohFeeder
from neurosnap.sources.mqtt import options as mqtt
from neurosnap.sources.mqtt.options import MqttOptions
from neurosnap.sources.protocol import Argument, Source
from neurosnap.sources.ros2 import options as ros2
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.wanted import Wanted
from neurosnap.system.distribution import must_have

A = TypeVar("A", "FileArguments", "LiveArguments")
K = TypeVar("K", MqttOptions, Ros2Options)
STDIN = "-"
ZENOH = "zenoh:"
MQTT = "mqtt:"
ROS2 = "ros2:"
_LEARNED = 0.25
"""The share of a file, from its beginning, that the cuts of a run are chosen by."""


def open_source(
    name: str,
    seed: int,
    arguments: Mapping[str, Argument] | None = None,
    hub: Hub | None = None,
    renders: bool = False,
) -> Source:
    """Return the source called `name`.

    Args:
        name: The path of a file that `open_readings` reads (it ends with ``.csv``, or
            the file exists), or the id of a Gymnasium environment, ``module:Id`` to
            import a module first; or a live one, as `open_live` has it.
        seed: For the environment's reset, from 0 up; a file does not use it.
        arguments: The environment's own; of a file as `FileArguments` has them.
        hub: The swarm's, for the part that is about to be its world.
        renders: Whether images of it are wanted; the observations are the same.

    Raises:
        InvalidValueError: There is no such source, it does not take such arguments, or
            it is not fit for use, or draws no images; for a file the text names the row
            and the column.
    """
    if seed < 0:
        raise InvalidValueError("seed", "must be 0 or more", seed)
    arguments = {} if arguments is None else arguments
    opened: Source
    if is_live(name):
        opened = open_live(name, arguments, hub)
    elif is_file(name):
        from neurosnap.sources.open_readings import FileSource

        arguments = {"cuts": "{}", **arguments}  # that were not chosen there are none
        opened = FileSource(name, _converted(arguments, FileArguments).wanted())
    else:
        # Here, not above: every part asks `is_live`, and Gymnasium is large.
        from neurosnap.sources.gymnasium_source import GymnasiumSource

        opened = GymnasiumSource(name, seed, arguments, renders)
    # Not refused by `Sensorium`: there may be recordings with such names.
    for called in (*opened.sensors, *opened.actions):
        if visible(called) != called:
            opened.close()
            rule = "must have no letters that hide, or turn the text around"
            raise InvalidValueError("name", rule, called)
    return opened


def is_file(name: str) -> bool:
    """Tell whether `name` is that of a source read from a file, or a bag's folder."""
    try:
        if name.lower().endswith(".csv") or Path(name).is_file():
            return True
        if not Path(name).is_dir():
            return False
        from neurosnap.sources.bag_records import is_bag

        return is_bag(name)
    except OSError:  # too long for a path, for one
        return False


def is_live(name: str) -> bool:
    """Tell whether `name` is that of a source that `open_live` opens."""
    return name in (STDIN, ZENOH, MQTT, ROS2)


def open_live(
    name: str,
    arguments: Mapping[str, Argument] | None = None,
    hub: Hub | None = None,
    *,
    journal: Journal | None = None,
    most: int | None = None,
) -> LiveSource:
    """Return the live source called `name`; nothing is started before its first tick.

    Args:
        name: ``-``, ``zenoh:``, ``mqtt:`` or ``ros2:``.
        arguments: As `LiveArguments` has them; `sensors` must be among them. For
            the last two one alone, `options`: `MqttOptions` or `Ros2Options` as JSON,
            as a file of ours has it in its table `[source]`.
        hub: The swarm's; None for a look only: ``zenoh:`` cannot be started.
        journal: As for `LiveSource`.
        most: As for `LiveSource`.

    Raises:
        InvalidValueError: There is no such source, or an argument is wrong.

    Examples:
        >>> source = open_live("-", {"sensors": "door,motion", "stale_after": 60})
        >>> source.sensors, source.live
        (('door', 'motion'), True)
        >>> source.close()
    """
    if not is_live(name):
        raise InvalidValueError(
            "source", f"must be {STDIN}, {ZENOH}, {MQTT} or {ROS2}", name
        )
    arguments = {} if arguments is None else arguments
    if name == MQTT:
        try:
            from neurosnap.sources.mqtt.mqtt_source import mqtt_source
        except ImportError as error:  # an extra
            rule = must_have(error.name or "aiomqtt", "mqtt")
            raise InvalidValueError("source", rule, "no such package") from error
        return mqtt_source(mqtt_options(arguments), journal=journal, most=most)
    if name == ROS2:
        options = ros2_options(arguments)
        ros2: LiveSource = _ros2().ros2_source(options, journal=journal, most=most)
        return ros2
    given = _converted(arguments, LiveArguments)
    if not (given.sensors or given.signals):
        rule = "must be named for such a source (--set sensors=a,b,c)"
        raise InvalidValueError("sensors", rule, given.sensors)
    readers = SignalReaders(given.read())
    latest = LatestReadings(
        readers.sensors,
        stale_after=given.stale_after,
        heard_within=readers.heard_within,
    )
    feeder: Feeder
    if name == STDIN:
        feeder = StdinFeeder(given.head.encode() if given.head else None)
    else:
        feeder = ZenohFeeder(hub)
    ticks = given.schedule()
    source = LiveSource(latest, ticks, feeder=feeder, journal=journal, most=most)
    source.readers, source.numbers = readers, readers.numbers
    return source


def _ros2() -> ModuleType:
    """Return the module of a source that needs an extra."""
    try:
        from neurosnap.sources.ros2 import ros2_source
    except ImportError as error:
        rule = must_have(error.name or "rosbags", "ros2")
        raise InvalidValueError("source", rule, "no such package") from error
    return ros2_source


class FileArguments(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a file is opened with: which sensors are read, and how."""

    sensors: str = ""
    """Names, patterns with ``*`` and ``?``, or conditions, commas between them, or as a
    JSON list; none: all."""
    when: str = ""
    """When sensors with numbers are on, as ``hall > 21``, semicolons between them."""
    time: str | None = None
    """The name of the column with the time; None for a first ``time``."""
    bins: int = 4
    """Parts that the range of a number is cut into; 0: none is."""
    every: float | str = 0.0
    """Seconds between the rows of messages, or a time (``100ms``); 0: as is usual."""
    cuts: str = ""
    """The sensors that other signals are cut into, in JSON; empty: not chosen yet."""

    def wanted(self) -> Wanted:
        """Return what is read.

        Raises:
            InvalidValueError: Something is no condition.
        """
        return Wanted(
            tuple(filter(None, _listed(self.sensors))),
            conditions_in(self.when),
            self.time,
            self.bins,
            parse_span(str(self.every), "every"),
            _LEARNED,
            recorded_signals(self.cuts) if self.cuts else None,
        )


class LiveArguments(TickRule, frozen=True):
    """What standard input or a swarm's own keys are opened with."""

    sensors: str = ""
    """Names and conditions, in order, commas between them, or as a JSON list."""
    bins: int = 4
    """Parts that the range of a number is cut into; 0: none is."""
    stretch: Seconds = 600.0
    """Seconds, at most, in which the ranges of numbers are learned first."""
    signals: str = ""
    """How signals are read, in JSON; empty: by `sensors`."""
    stale_after: Seconds | None = None
    """Seconds after which a reading is believed no more; None if it always is."""
    head: str = ""
    """The first lines of standard input, where they were read to learn the sensors."""

    def read(self) -> Signals:
        """Return how signals are read.

        Raises:
            InvalidValueError: It is said wrongly.
        """
        if self.signals:
            return recorded_signals(self.signals)
        return signals_of(_listed(self.sensors))


def _listed(sensors: str) -> tuple[str, ...]:
    """Return names, commas between them or as a JSON list.

    Raises:
        InvalidValueError: It is no list of texts.
    """
    if not sensors.startswith("["):
        return tuple(name.strip() for name in sensors.split(","))
    try:
        return msgspec.json.decode(sensors, type=tuple[str, ...])
    except msgspec.MsgspecError as error:
        rule = f"must be names with commas between them, or a JSON list ({error})"
        raise InvalidValueError("sensors", rule, sensors) from error


def needs_listening(name: str, arguments: Mapping[str, Argument]) -> bool:
    """Return whether only what a source says tells its sensors: `settle` waits for it.

    Raises:
        InvalidValueError: An argument is wrong.
    """
    if name == MQTT:
        return any(sensor.bins for sensor in mqtt_options(arguments).sensors)
    if name == ROS2:
        said = ros2_options(arguments)
        return bool(said.bins and said.plain)
    if name != STDIN:
        return False
    given = _converted(arguments, LiveArguments)
    return not (given.sensors or given.signals)


def settle(name: str, arguments: Mapping[str, Argument]) -> dict[str, Argument]:
    """Return the arguments with the sensors in them, once and for all.

    Standard input can be read once only, and numbers of a file are cut by its
    beginning, those of a live source by what it says in a first stretch. So the command
    that starts a run calls this first, and every part opens the source with what it
    returns.

    Args:
        name: As for `open_live`.
        arguments: As for `open_live`.

    Raises:
        InvalidValueError: The first line names no sensors, a number says nothing, or an
            argument is wrong.
        NeurosnapError: What is to be listened to cannot be reached.
    """
    if is_file(name):
        from neurosnap.sources.open_readings import settled

        wanted = settled(name, _converted(arguments, FileArguments).wanted())
        if wanted.every_condition() or wanted.cuts:
            return {**arguments, "cuts": as_json(wanted.cuts or {})}
    if not needs_listening(name, arguments):
        return dict(arguments)
    if name == MQTT:
        from neurosnap.sources.mqtt.mqtt_source import cut

        options = cut(mqtt_options(arguments))
        return {"options": msgspec.json.encode(options).decode()}
    if name == ROS2:
        said = _ros2().cut(ros2_options(arguments))
        return {"options": msgspec.json.encode(said).decode()}
    given = _converted(arguments, LiveArguments)
    head, signals = first_lines(given.stretch, given.bins)
    return {**arguments, "signals": as_json(signals), "head": head.decode()}


def as_in_run(
    name: str, arguments: Mapping[str, Argument], run: Mapping[str, Argument]
) -> dict[str, Argument]:
    """Return arguments with what only listening tells, as a run had it.

    Args:
        name: As for `open_live`.
        arguments: Which may need it.
        run: The arguments that the run recorded; they decide nothing else.

    Raises:
        InvalidValueError: An argument is wrong.
    """
    if not needs_listening(name, arguments):
        return dict(arguments)
    options: MqttOptions | Ros2Options
    if name == MQTT:
        options = mqtt.with_cuts_of(mqtt_options(arguments), mqtt_options(run))
    elif name == ROS2:
        options = ros2.with_cuts_of(ros2_options(arguments), ros2_options(run))
    else:
        return dict(run)
    return {"options": msgspec.json.encode(options).decode()}


def mqtt_options(arguments: Mapping[str, Argument]) -> MqttOptions:
    """Return the options that the arguments of an ``mqtt:`` source hold.

    Raises:
        InvalidValueError: They hold none, or wrong ones.
    """
    return _options(arguments, MqttOptions, "an MQTT source")


def ros2_options(arguments: Mapping[str, Argument]) -> Ros2Options:
    """Return the options that the arguments of a ``ros2:`` source hold.

    Raises:
        InvalidValueError: They hold none, or wrong ones.
    """
    return _options(arguments, Ros2Options, "a source of ROS 2")


def _options(arguments: Mapping[str, Argument], kind: type[K], what: str) -> K:
    try:
        return msgspec.json.decode(str(arguments["options"]), type=kind)
    except (KeyError, msgspec.MsgspecError) as error:
        rule = f"must hold the options of {what}: name a file that describes one"
        raise InvalidValueError("arguments", rule, str(error)) from error


def lost_by(name: str, counted: Statistics | None) -> int:
    """Return how many readings of a live source are lost; an outage counts as one.

    What standard input says is meant for the run, so a line that is no reading is lost.
    On a broker and on a hub others may say what they like.
    """
    if counted is None:
        return 0
    received = counted.received
    refused = received.refused if name == STDIN else 0
    return received.dropped + received.missing + received.outages + refused


def _converted(arguments: Mapping[str, Argument], kind: type[A]) -> A:
    try:
        return msgspec.convert(dict(arguments), kind)
    except msgspec.ValidationError as error:
        rule = f"must be ones such a source takes ({error})"
        raise InvalidValueError("arguments", rule, dict(arguments)) from error
