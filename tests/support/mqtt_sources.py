"""Sources of a house on a broker, and waits for what they read."""

import asyncio
from collections.abc import Callable
from contextlib import closing

import msgspec

from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.mqtt.mqtt_source import mqtt_source
from neurosnap.sources.mqtt.options import (
    MqttBroker,
    MqttOptions,
    MqttPublish,
    MqttSensor,
    MqttTick,
)
from tests.support.sources import readings

AT_ONCE = MqttTick(min_interval=0)
PREFIX = "neurosnap/house"


def options(broker: MqttBroker, *sensors: MqttSensor, **more: object) -> MqttOptions:
    """Sensors of a house, with ticks on every change."""
    given = sensors or (MqttSensor(name="door", topic="house/door"),)
    table = MqttOptions(broker=broker, sensors=given, tick=AT_ONCE)
    return msgspec.structs.replace(table, publish=MqttPublish(prefix=PREFIX), **more)


def source_of(table: MqttOptions) -> "closing[LiveSource]":
    return closing(mqtt_source(table))


def reading(source: LiveSource) -> dict[str, bool | None]:
    """The next tick, by name."""
    seen = source.step(0)
    assert seen is not None
    return dict(zip(source.sensors, readings(seen), strict=True))


async def until(
    source: LiveSource, wanted: Callable[[dict[str, bool | None]], bool]
) -> dict[str, bool | None]:
    """The first tick that is as wanted."""
    while True:
        found = await asyncio.to_thread(reading, source)
        if wanted(found):
            return found
