"""The options of a source of ROS 2; stored in the recording.

Nothing here connects, or needs the libraries that do: a recording is read without them.
"""

import re
from typing import Annotated, Literal

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sources.conditions import Condition, is_condition, parse_condition
from neurosnap.sources.live.tick_schedule import Seconds, TickRule
from neurosnap.sources.message_fields import parse_term

ROUTER = "tcp/localhost:7447"
"""Where the router of ROS 2 listens if nothing is said."""
Words = Annotated[str, msgspec.Meta(min_length=1, max_length=1024)]
_TOPIC = re.compile(r"/[A-Za-z_][\w/]*(?=$|[.\[])", re.ASCII)
_NAME = re.compile(r"(/[A-Za-z]\w*)+", re.ASCII)
_ROUTER = re.compile(r"(tcp|tls|quic|ws|unixsock-stream)/[^\s?#]+", re.ASCII)


class Ros2Tick(TickRule, frozen=True):
    """When a tick happens: by the clock, or on change."""

    min_interval: Annotated[float, msgspec.Meta(ge=0, le=31_536_000)] = 0.1
    """Without `interval`: seconds between two ticks at least."""


class Ros2Publish(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """What is published of the run itself: diagnostics."""

    topic: Words = "/diagnostics"
    """Where to."""
    node: Annotated[str, msgspec.Meta(pattern="^[A-Za-z_][A-Za-z0-9_]{0,127}$")] = (
        "neurosnap"
    )
    """What the node is called that publishes them."""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.topic):
            raise InvalidValueError("topic", "must be like /diagnostics", self.topic)


class Ros2Options(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="ros2",
):
    """The options of a source of ROS 2: sensors by the fields of topics."""

    router: Words = ROUTER
    """Where the router of the graph is, as Zenoh writes it; nothing else is listened
    to."""
    through: Literal["zenoh", "rclpy"] = "zenoh"
    """What it is heard through: Zenoh, without any ROS; or `rclpy`, which must be
    installed, and over whatever middleware that has. The router is Zenoh's alone."""
    domain: Annotated[int, msgspec.Meta(ge=0, le=232)] = 0
    """The domain of the graph (`ROS_DOMAIN_ID`)."""
    sensors: Annotated[tuple[Words, ...], msgspec.Meta(min_length=1)]
    """The sensors, in order: fields such as `/door.data`, or conditions such as
    `/battery_state.percentage < 0.2`, `min(/scan.ranges[0:80]) < 0.5`, `/mode.data =
    auto` or `/scan heard within 0.5 s`. A field of numbers or words becomes several,
    and a topic alone those of its fields, by what they say before the run begins."""
    bins: Annotated[int, msgspec.Meta(ge=0)] = 4
    """Parts that the range of a number is cut into; 0: none is, and nothing is listened
    to before the run."""
    stretch: Seconds = 60.0
    """Seconds, at most, in which ranges and words are learned first."""
    msg_files: tuple[Words, ...] = ()
    """Files `PACKAGE/msg/TYPE.msg` of types that neither come with ROS 2 nor are
    described by the node that publishes them."""
    stale_after: Seconds | None = None
    """Seconds after which a reading no longer counts and the sensor is unknown; None:
    a reading counts until the next one, or until nothing publishes the topic."""
    patience: Seconds = 10.0
    """Seconds a start may take until it is connected; afterwards there is no limit."""
    tick: Ros2Tick = Ros2Tick()
    """When a tick happens."""
    publish: Ros2Publish | None = None
    """What is published of the run; if None, nothing."""

    def __post_init__(self) -> None:
        if not _ROUTER.fullmatch(self.router):
            rule = "must be like tcp/localhost:7447, without ? and #"
            raise InvalidValueError("router", rule, self.router)
        if self.publish is not None and self.through != "zenoh":
            rule = 'must be "zenoh" where something is published'
            raise InvalidValueError("through", rule, self.through)
        for sensor in self.sensors:
            topic_of(signal_of(sensor))

    @property
    def plain(self) -> tuple[str, ...]:
        """The sensors that are named without a condition."""
        return tuple(each for each in self.sensors if not is_condition(each))


def conditions_of(options: Ros2Options) -> dict[str, Condition]:
    """Return when sensors are on, by name."""
    found = map(parse_condition, filter(is_condition, options.sensors))
    return {condition.name: condition for condition in found}


def with_cuts_of(options: Ros2Options, run: Ros2Options) -> Ros2Options:
    """Return options whose numbers and words are cut as they were in a run."""
    sensors: list[str] = []
    for sensor in options.sensors:
        sensors += (
            [sensor]
            if sensor not in options.plain
            else (
                text
                for text in run.sensors
                if text == sensor
                or (
                    text not in options.sensors
                    and sensor in (signal := signal_of(text), topic_of(signal))
                )
            )
        )
    found = tuple(sensors) or options.sensors
    return msgspec.structs.replace(options, sensors=found, bins=0)


def signal_of(sensor: str) -> str:
    """Return the signal that a sensor reads.

    Examples:
        >>> signal_of("/scan heard within 1 s"), signal_of("/door.data")
        ('/scan', '/door.data')
    """
    return parse_condition(sensor).source if is_condition(sensor) else sensor


def topic_of(signal: str) -> str:
    """Return the topic of a signal.

    Raises:
        InvalidValueError: It is none of a topic.

    Examples:
        >>> topic_of("min(/robot/scan.ranges[0:80])"), topic_of("/door.data")
        ('/robot/scan', '/door')
    """
    term = parse_term(signal)
    match = _TOPIC.match(signal if term is None else term.path)
    if match is None:
        rule = "must be of a topic, like /door.data or /battery_state.percentage < 0.2"
        raise InvalidValueError("sensor", rule, signal)
    return match[0]
