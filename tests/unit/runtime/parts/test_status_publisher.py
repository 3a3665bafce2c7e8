"""Who tells a broker of a run ends with it, and says so, however that ends."""

import asyncio

import msgspec
import pytest

from neurosnap.agent.body import Body
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.status_publisher import STATUS_PUBLISHER, publish_status
from neurosnap.sources.mqtt.options import MqttOptions, MqttPublish, MqttSensor
from neurosnap.sources.open_live import MQTT
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


async def run_with(
    broker: Broker,
    monkeypatch: pytest.MonkeyPatch,
    *,
    stopped: bool = False,
    failure: Exception | None = None,
) -> None:
    """Be an outlet, and end it in some way once it is ready."""
    monkeypatch.setattr(
        "neurosnap.sources.mqtt.publisher.MqttPublisher", lambda *_, **__: broker
    )
    stop = asyncio.Event()
    async with (
        MemoryHub().fabric(STATUS_PUBLISHER) as fabric,
        asyncio.timeout(PATIENCE),
    ):

        def on_ready() -> None:
            if failure is not None:
                fabric.fail(failure)
            if stopped:
                stop.set()

        await publish_status(options(), fabric, stop, on_ready)


async def test_it_ends_when_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    broker = Broker()
    await run_with(broker, monkeypatch, stopped=True)
    assert broker.said_goodbye


async def test_it_ends_once_nothing_can_be_heard_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broker = Broker()
    with pytest.raises(FabricError, match=r"^the link is lost$"):
        await run_with(broker, monkeypatch, failure=FabricError("the link is lost"))
    assert broker.said_goodbye


async def test_it_ends_when_the_broker_refuses_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    refusal = InvalidValueError("username", "must be one the broker knows", "me")
    with pytest.raises(InvalidValueError, match=r"^username: must be one"):
        await run_with(Broker(refusal), monkeypatch)
