"""Outlets on a real Mosquitto, which every test starts for itself.

Nothing waits for a time: a broker is there once it says so, a client once its status
topic says ``online``, and readings show in ticks.
"""

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.sensorium import pack
from neurosnap.sources.mqtt.options import MqttPublish
from neurosnap.sources.mqtt.publisher import MqttPublisher
from tests.support.mosquitto import Mosquitto, heard, needs_mosquitto, peer, started
from tests.support.mqtt_sources import PREFIX, options, source_of
from tests.support.retained import kept, left

pytestmark = [
    pytest.mark.slow,
    needs_mosquitto,
]


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    with started(tmp_path, "allow_anonymous true") as broker:
        yield broker


STATE = wire.State(
    tick=1,
    wave=1,
    literals=pack([1, 0, 0, 1, 0, 0]),
    incoherent=False,
    depth=0,
    longest=0,
    height=0,
    edges=0,
    pulses=0,
)


@pytest.mark.parametrize("forget", [False, True])
async def test_home_assistant_finds_beliefs_predictions_and_anomalies(
    broker: Mosquitto, forget: bool
) -> None:
    publish = MqttPublish(prefix=PREFIX, device="House", forget=forget)
    names = ["door", "hall motion", "light", "light&door"]
    outlet = MqttPublisher(broker.options, publish, names, own=3, actions=["off", "on"])
    state = msgspec.structs.replace(STATE, literals=pack([1, 0, 0, 1, 0, 0, 1, 0]))
    outlet.state(state, np.array([True, False, False, True]))
    stop = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        serving = group.create_task(outlet.serve(stop))
        outlet.decision(wire.Decision(1, 1, "greedy"))
        outlet.anomaly({"tick": 1, "culprits": ["door"]})
        async with peer(broker, f"{PREFIX}/#") as other:
            await heard(other, f"{PREFIX}/sensor/hall_motion", b"OFF")
            outlet.state(msgspec.structs.replace(state, tick=2))
            outlet.anomaly(None)
            await heard(
                other,
                f"{PREFIX}/anomaly",
                b'{"now":"OFF","last":{"tick":1,"culprits":["door"]}}',
            )
        found = await kept(broker, f"{PREFIX}/#", f"{PREFIX}/decision")
        assert found == {
            f"{PREFIX}/status": b"online",
            f"{PREFIX}/sensor/door": b"ON",
            f"{PREFIX}/sensor/hall_motion": b"OFF",
            f"{PREFIX}/sensor/light": b"unknown",
            f"{PREFIX}/predictions": b"{}",
            f"{PREFIX}/decision": b'{"action":"on","why":"greedy"}',
            f"{PREFIX}/anomaly": b'{"now":"OFF","last":{"tick":1,"culprits":["door"]}}',
            f"{PREFIX}/progress": b'{"ticks":2,"implications":0,"read":3,"of":3}',
        }
        told = await kept(broker, "homeassistant/#", "homeassistant/#")
        stop.set()
        await serving
    assert list(told) == ["homeassistant/device/neurosnap_house/config"]
    device = json.loads(told["homeassistant/device/neurosnap_house/config"])
    assert device["availability"] == [{"topic": f"{PREFIX}/status"}]
    topics = {each["state_topic"] for each in device["components"].values()}
    assert topics == set(found) - {f"{PREFIX}/status"}
    offline = {f"{PREFIX}/status": b"offline"}
    assert await left(broker) == ({} if forget else found | told | offline)


@pytest.mark.parametrize("forget", [False, True])
async def test_the_status_of_who_reads_is_taken_back_with_the_rest(
    broker: Mosquitto, forget: bool
) -> None:
    table = msgspec.structs.replace(
        options(broker.options), publish=MqttPublish(prefix=PREFIX, forget=forget)
    )
    status = f"{PREFIX}/world/status"
    async with peer(broker, status) as other:
        with source_of(table) as source:
            waiting = asyncio.create_task(asyncio.to_thread(source.first))
            await heard(other, status, b"online")
            await asyncio.to_thread(source.close)
            assert await waiting is None
    assert await left(broker) == ({} if forget else {status: b"offline"})


async def test_predictions_are_of_what_was_not_read(broker: Mosquitto) -> None:
    outlet = MqttPublisher(
        broker.options,
        MqttPublish(prefix=PREFIX, discovery=False),
        ["door", "hall", "light"],
    )
    stop = asyncio.Event()
    async with peer(broker, f"{PREFIX}/predictions") as other, asyncio.TaskGroup() as g:
        g.create_task(outlet.serve(stop))
        outlet.state(STATE, np.array([False, False, True]))
        await heard(other, f"{PREFIX}/predictions", b'{"door":"ON","hall":"OFF"}')
        outlet.state(STATE, np.array([True, False, False]))
        await heard(other, f"{PREFIX}/predictions", b'{"hall":"OFF"}')
        stop.set()
    assert await kept(broker, "homeassistant/#", f"{PREFIX}/status") == {}


async def test_an_outlet_tells_a_restarted_broker_everything_again(
    broker: Mosquitto,
) -> None:
    outlet = MqttPublisher(broker.options, MqttPublish(prefix=PREFIX), ["a", "b", "c"])
    outlet.state(STATE)
    stop = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        group.create_task(outlet.serve(stop))
        async with peer(broker, f"{PREFIX}/#") as other:
            await heard(other, f"{PREFIX}/sensor/a", b"ON")
        broker.stop()
        broker.start()
        async with peer(broker, "#") as other:
            await heard(other, f"{PREFIX}/sensor/b", b"OFF")
        told = await kept(broker, "homeassistant/#", "homeassistant/#")
        stop.set()
    assert len(told) == 1
