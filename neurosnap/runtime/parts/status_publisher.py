"""The status publisher: reports on a run, to its launcher, over MQTT and to ROS 2.

It follows which sensors of a home seem broken, where there is a budget of alarms, and
publishes beliefs and anomalies for a source of MQTT or ROS 2 with a table `publish`.
It reads what the world and the coordinator say, and publishes nothing in the swarm.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import body_after
from neurosnap.errors import InvalidValueError, MessageError, ShapeError
from neurosnap.fabric.protocol import Fabric
from neurosnap.health.alarm import Standing
from neurosnap.health.alarm_budget import NEVER
from neurosnap.protocol.anomaly_report import (
    anomaly_record,
    named_anomaly,
    with_support,
)
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.job import PartContext
from neurosnap.sources.open import MQTT, ROS2, mqtt_options, ros2_options

if TYPE_CHECKING:
    from neurosnap.sources.mqtt.publisher import MqttPublisher
    from neurosnap.sources.ros2.diagnostics_publisher import DiagnosticsPublisher

STATUS_PUBLISHER = "watcher/outlet"
"""Its name: it has no last word, and no part waits for it."""
Publisher: TypeAlias = "MqttPublisher | DiagnosticsPublisher"
_PUBLISHED = ("state", "anomaly", "decision")


def has_status(options: RunOptions) -> bool:
    """Tell whether a run has such a part.

    Raises:
        InvalidValueError: The options of its source are wrong.
    """
    if options.alarms != NEVER:
        return True
    if options.source == ROS2:
        return ros2_options(options.arguments).publish is not None
    if options.source != MQTT:
        return False
    return mqtt_options(options.arguments).publish is not None


class StatusListener:
    """Passes a swarm's messages to a publisher, on the fabric's thread.

    Args:
        publisher: Publishes it.
        body: What is sensed at first.
        support: The occasions that an anomaly must rest on.
    """

    def __init__(self, publisher: "Publisher", body: Body, support: int = 0) -> None:
        self._publisher = publisher
        self._support = support
        self._body = body
        self._wrong = -1  # the last tick that was an anomaly's
        self._calm = True

    def receive(self, message: wire.Message) -> None:
        """Receive one message; of other kinds it passes over."""
        match message:
            case wire.Observation():
                self._publisher.observation(message)
            case wire.State():
                self._publisher.state(message)
                if message.tick > self._wrong and not self._calm:
                    self._calm = True
                    self._publisher.anomaly(None)
            case wire.Anomaly(tick=tick):
                rest = with_support(message, self._support)
                if rest is not None:
                    self._wrong, self._calm = tick, False
                    record = named_anomaly(rest, self._body)
                    self._publisher.anomaly(anomaly_record(record))
            case wire.Decision():
                self._publisher.decision(message)
                self._body = body_after(self._body, message)
            case _:
                pass


async def publish_status(
    options: RunOptions,
    fabric: Fabric,
    stop: asyncio.Event,
    on_ready: Callable[[], None] = lambda: None,
    on_health: Callable[[Standing], None] = lambda _: None,
    past: ResumePoint | None = None,
) -> None:
    """Report on a run until `stop` is set.

    Reads ``observation``, and for a broker ``state``, ``anomaly`` and ``decision``;
    publishes nothing in the swarm. A message that cannot be right is passed over: those
    it is for say so.

    Args:
        options: The run's.
        fabric: Entered by the caller.
        stop: Ends it.
        on_ready: Called once it misses nothing any more.
        on_health: Called with the health of the sensors when that is new.
        past: Of a run that is resumed: what was grown before, and where the readings
            are.

    Raises:
        InvalidValueError: The broker refuses the name, the password or a topic.
        NeurosnapError: The broker cannot be reached at the start; or nothing more can
            be heard of the swarm.
    """
    from neurosnap.runtime.parts.health_listener import HealthListener, Past

    publisher = _publisher(options, past is not None)
    body, tasks, over = options.body, [], asyncio.Event()
    health = listener = None
    if options.alarms != NEVER:

        def report(standing: Standing) -> None:
            on_health(standing)
            if publisher is not None:
                publisher.health(standing)

        recorded = None if past is None else Past.of(past)
        health = HealthListener(options, report, recorded)
        tasks.append(asyncio.create_task(health.serve(over), name="status/health"))
    if publisher is not None:
        now = body if past is None else past.body(body)
        listener = StatusListener(publisher, now, options.support)
        tasks.append(asyncio.create_task(publisher.serve(over), name="status/publish"))

    def handle(deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            with contextlib.suppress(MessageError, ShapeError, InvalidValueError):
                message = wire.decode(delivery.key, delivery.payload)
                if health is not None and isinstance(message, wire.Observation):
                    health.receive(message, delivery.sent)
                if listener is not None:
                    listener.receive(message)

    await fabric.subscribe(("observation", *(_PUBLISHED if listener else ())), handle)
    await fabric.confirm()
    on_ready()
    hearing = asyncio.create_task(fabric.serve(stop), name="status/hear")
    try:
        await asyncio.wait((hearing, *tasks), return_when=asyncio.FIRST_COMPLETED)
        # Also where nothing can be heard any more: the broker is told that it is over.
        over.set()
        for task in tasks:
            await task
        await hearing
    finally:
        for task in (hearing, *tasks):
            task.cancel()


def _publisher(options: RunOptions, resumed: bool) -> "Publisher | None":
    """Return what publishes a run where its source is; None if it is not."""
    body = options.body
    if options.source == ROS2:
        graph = ros2_options(options.arguments)
        if graph.publish is None:
            return None
        from neurosnap.sources.ros2.diagnostics_publisher import DiagnosticsPublisher

        return DiagnosticsPublisher(graph, body.sensors, len(body.own), resumed=resumed)
    if options.source != MQTT:
        return None
    given = mqtt_options(options.arguments)
    if given.publish is None:
        return None
    from neurosnap.sources.mqtt.publisher import MqttPublisher

    return MqttPublisher(
        given.broker,
        given.publish,
        body.sensors,
        own=len(body.own),
        actions=body.actions,
        judges=options.alarms != NEVER,
    )


class StatusJob(msgspec.Struct, frozen=True):
    """The job of the status publisher."""

    options: RunOptions
    past: ResumePoint | None = None

    async def run(self, part: PartContext) -> None:
        """Go on until the run is over."""
        say = part.reporter
        async with part.connection.fabric() as fabric:
            await publish_status(
                self.options, fabric, part.stop, say.ready, say.health, self.past
            )
        say.done()
