"""The MQTT publisher ends with its run, and announces the end."""

import asyncio
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any
from unittest.mock import Mock, call

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.status_publisher import (
    STATUS_PUBLISHER,
    StatusListener,
    has_status,
    publish_status,
)
from neurosnap.sources.mqtt.options import MqttOptions, MqttPublish, MqttSensor
from neurosnap.sources.open import MQTT, ROS2
from neurosnap.sources.ros2.options import Ros2Options, Ros2Publish
from tests.support.patience import PATIENCE

pytest.importorskip("aiomqtt")


class Broker:
    """Stands in for the link to a broker."""

    def __init__(self, refusal: Exception | None = None) -> None:
        self.said_goodbye = False
        self._refusal = refusal

    async def serve(self, stop: asyncio.Event) -> None:
        if self._refusal is not None:
            raise self._refusal
        await stop.wait()
        self.said_goodbye = True


def options() -> RunOptions:
    sensors = (MqttSensor(name="door", topic="door"),)
    told = msgspec.json.encode(MqttOptions(sensors=sensors, publish=MqttPublish()))
    return RunOptions(
        source=MQTT, arguments={"options": told.decode()}, body=Body(own=("door",))
    )


LOST = FabricError("the link is lost")
REFUSAL = InvalidValueError("username", "must be one the broker knows", "me")


@pytest.mark.parametrize(
    ("refusal", "failure", "error"),
    [
        (None, None, nullcontext()),
        (None, LOST, pytest.raises(FabricError, match=r"^the link is lost$")),
        (REFUSAL, None, pytest.raises(InvalidValueError, match=r"^username: must be")),
    ],
    ids=["as asked", "nothing can be heard any more", "the broker refuses it"],
)
async def test_it_ends_and_says_so(
    refusal: Exception | None,
    failure: Exception | None,
    error: AbstractContextManager[Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broker, stop = Broker(refusal), asyncio.Event()
    monkeypatch.setattr(
        "neurosnap.sources.mqtt.publisher.MqttPublisher", lambda *_, **__: broker
    )
    async with (
        MemoryHub().fabric(STATUS_PUBLISHER) as fabric,
        asyncio.timeout(PATIENCE),
    ):

        def on_ready() -> None:
            if failure is not None:
                fabric.fail(failure)
            elif refusal is None:
                stop.set()

        with error:
            await publish_status(options(), fabric, stop, on_ready)
    assert broker.said_goodbye == (refusal is None)


class Robot:
    """Stands in for what publishes to ROS 2."""

    def __init__(self) -> None:
        self.heard: list[wire.Message] = []
        self.observation = self.state = self.decision = self.heard.append

    async def serve(self, stop: asyncio.Event) -> None:
        await stop.wait()


@pytest.mark.parametrize("publish", [None, Ros2Publish(node="spot")])
@pytest.mark.parametrize("past", [None, ResumePoint("log", 3, (), b"", {}, (3,))])
async def test_a_robot_hears_what_is_read_and_believed_if_it_is_to(
    publish: Ros2Publish | None,
    past: ResumePoint | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = Ros2Options(sensors=("/door.data",), publish=publish)
    body, told = Body.full(["/door.data"], ["push"]), msgspec.json.encode(graph)
    arguments: dict[str, Any] = {"options": told.decode()}
    given = RunOptions(source=ROS2, arguments=arguments, body=body)
    assert has_status(given) == (publish is not None)
    stop, hub, robot = asyncio.Event(), MemoryHub(), Robot()
    made = Mock(return_value=robot)
    monkeypatch.setattr(
        "neurosnap.sources.ros2.diagnostics_publisher.DiagnosticsPublisher", made
    )
    said: list[wire.Message] = [
        wire.Observation(1, b"\1"),
        wire.State(1, 1, b"\1", False, 0, 0, 0, 0, 0),
        wire.Decision(1, 0, "by chance"),
    ]
    async with (
        hub.fabric(STATUS_PUBLISHER) as fabric,
        hub.fabric("world") as world,
        asyncio.timeout(PATIENCE),
    ):

        def on_ready() -> None:
            for message in said:
                world.publish(message)
            stop.set()

        await publish_status(given, fabric, stop, on_ready, past=past)
    assert robot.heard == (said if publish else [])
    how = call(graph, body.sensors, 1, resumed=past is not None)
    assert made.mock_calls == ([how] if publish else [])


class Anomalies:
    """Stands in for a publisher, and keeps which implications were broken."""

    def __init__(self) -> None:
        self.said: list[list[str]] = []

    def decision(self, decision: wire.Decision) -> None:
        pass

    def anomaly(self, record: Mapping[str, Any] | None) -> None:
        assert record is not None
        self.said.append([link["implication"] for link in record["broken"]])


@pytest.mark.parametrize("before", [0, 1])
def test_grown_sensors_are_called_by_their_formulas_once_they_are_born(
    before: int,
) -> None:
    body = Body.full(["door", "dark"], ["push"], room=2)
    first, contexts = body.first_grown, (Context(0, (0, 2)), Context(0, (0, 3)))
    past = ResumePoint("log", 3, (), b"", {}, (3,), grown=contexts[:before])
    publisher = Anomalies()
    listener = StatusListener(publisher, past.body(body))  # type: ignore[arg-type]
    links = [wire.WeighedLink(k, 2 * (first + k), 0, 9.0, 0.0, 1) for k in (0, 1)]
    broken = wire.Anomaly(6, 6, (), (), True, 2, tuple(links))
    listener.receive(broken)
    for tick, context in enumerate(contexts[before:], 4):
        born = first + before + tick - 4
        listener.receive(wire.Decision(tick, 0, "by chance", born, *context))
    listener.receive(wire.Decision(6, 0, "by chance", retires=first))
    listener.receive(broken)
    names = "push&door&dark", "push&door&~dark"
    early = (names[0] if before else "grown 1", "grown 2")
    assert publisher.said == [
        [f"{name} -> door" for name in several] for several in (early, names)
    ]
