"""The embedded broker serves a source, and says what it fails of."""

import aiomqtt
import pytest
from amqtt.broker import Broker  # type: ignore[import-untyped]

from neurosnap.errors import InvalidValueError
from neurosnap.sources.mqtt.embedded_broker import EmbeddedBroker
from neurosnap.sources.mqtt.options import MqttBroker
from tests.support.mosquitto import HOST, needs_mosquitto
from tests.support.mqtt_sources import options, source_of, until

pytestmark = [
    pytest.mark.slow,
    needs_mosquitto,
]


async def test_the_embedded_broker_serves_a_source() -> None:
    with EmbeddedBroker() as broker:
        table = options(MqttBroker(host=HOST, port=broker.port))
        with source_of(table) as source:
            async with aiomqtt.Client(HOST, broker.port) as other:
                await other.publish("house/door", "ON", qos=1, retain=True)
                await until(source, lambda r: r["door"] is True)
                await other.publish("house/door", "OFF", qos=1)
                await until(source, lambda r: r["door"] is False)


def test_what_the_embedded_broker_fails_of_is_raised_at_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shutdown = Broker.shutdown

    async def fails(broker: Broker) -> None:
        await shutdown(broker)
        raise OSError("broken off")

    monkeypatch.setattr(Broker, "shutdown", fails)
    with pytest.raises(OSError, match=r"^broken off$"), EmbeddedBroker():
        pass


def test_the_embedded_broker_says_that_its_port_is_taken() -> None:
    with (
        EmbeddedBroker() as broker,
        pytest.raises(
            InvalidValueError, match=rf"^port: .* in use\), got {broker.port}$"
        ),
        EmbeddedBroker(broker.port),
    ):
        pass
