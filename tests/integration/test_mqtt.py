"""Sources on a real Mosquitto, which every test starts for itself.

Nothing waits for a time: a broker is there once it says so, a client once its status
topic says ``online``, and readings show in ticks.
"""

import asyncio
import re
import resource
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from neurosnap.sources.mqtt.options import MqttAction, MqttSensor
from tests.support.mosquitto import (
    HOST,
    Mosquitto,
    heard,
    needs_mosquitto,
    peer,
    started,
)
from tests.support.mqtt_sources import PREFIX, options, reading, source_of, until

pytestmark = [
    pytest.mark.slow,
    needs_mosquitto,
]


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    with started(tmp_path, "allow_anonymous true") as broker:
        yield broker


async def test_what_the_broker_kept_is_the_first_reading(broker: Mosquitto) -> None:
    sensors = (
        MqttSensor(name="door", topic="house/+/door", combine="last"),
        MqttSensor(name="warm", topic="house/climate", field="t", on_above=20),
        MqttSensor(name="phone", topic="house/#", seen_within=60),
    )
    async with peer(broker) as other:
        await other.publish("house/hall/door", "OPEN", qos=1, retain=True)
        await other.publish("house/climate", '{"t": 19.5}', qos=1, retain=True)
        with source_of(options(broker.options, *sensors)) as source:
            found = await until(source, lambda r: None not in (r["door"], r["warm"]))
            # Nobody knows when what was kept was said: it is no sign of life.
            assert found == {"door": True, "warm": False, "phone": None}
            await other.publish("house/garden/door", "closed", qos=1)
            found = await until(source, lambda r: r["phone"] is not None)
            assert found == {"door": False, "warm": False, "phone": True}


async def test_topics_of_a_wildcard_combine(broker: Mosquitto) -> None:
    sensors = (
        MqttSensor(name="some", topic="house/+/motion"),
        MqttSensor(name="every", topic="house/+/motion", combine="all"),
        MqttSensor(name="latest", topic="house/+/motion", combine="last"),
    )
    steps = [
        ("kitchen", "ON", (True, True, True)),
        ("bath", "OFF", (True, False, False)),
        ("bath", "ON", (True, True, True)),
        ("kitchen", "OFF", (True, False, False)),
        ("bath", "unavailable", (False, False, None)),
    ]
    async with peer(broker, f"{PREFIX}/world/status") as other:
        with source_of(options(broker.options, *sensors)) as source:
            shown = asyncio.create_task(asyncio.to_thread(reading, source))
            await heard(other, f"{PREFIX}/world/status", b"online")
            for room, word, expected in steps:
                await other.publish(f"house/{room}/motion", word, qos=1)
                assert tuple((await shown).values()) == expected
                shown = asyncio.create_task(asyncio.to_thread(reading, source))
            await other.publish("house/bath/motion", "ON", qos=1)
            await shown


async def test_an_action_is_published_and_doing_nothing_is_not(
    broker: Mosquitto,
) -> None:
    actions = (
        MqttAction(name="light", topic="house/light/set", payload="ON", retain=True),
        MqttAction(name="bell", topic="house/bell", payload="ring"),
    )
    async with peer(broker, "house/light/set", "house/bell") as other:
        await other.publish("house/door", "ON", qos=1, retain=True)
        with source_of(options(broker.options, actions=actions)) as source:
            assert source.actions == ("none", "light", "bell")
            assert source.exclusive
            assert await asyncio.to_thread(source.first) is not None
            for choice, word in ((2, "OFF"), (0, "ON"), (1, "OFF")):
                await other.publish("house/door", word)
                await asyncio.to_thread(source.step, choice)
            got = [await anext(other.messages) for _ in range(2)]
    assert [(m.topic.value, m.payload, m.qos) for m in got] == [
        ("house/bell", b"ring", 1),
        ("house/light/set", b"ON", 1),
    ]


async def test_what_to_do_is_given_up_when_nobody_takes_it_in_time(
    broker: Mosquitto,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    bell = MqttAction(name="bell", topic="house/bell", payload="ring")
    with source_of(options(broker.options, actions=(bell,))) as source:
        async with peer(broker) as other:
            await other.publish("house/door", "ON", qos=1, retain=True)
            await until(source, lambda r: r["door"] is True)
        broker.stop()
        monkeypatch.setattr("neurosnap.sources.mqtt.outbox.LASTS", 0.0)
        waiting = asyncio.create_task(asyncio.to_thread(source.step, 1))
        broker.start()
        async with peer(broker, "house/#", f"{PREFIX}/world/status") as other:
            await heard(other, f"{PREFIX}/world/status", b"online")
            await other.publish("house/door", "OFF", qos=1)
            await waiting
            assert (await anext(other.messages)).topic.value == "house/door"
    said = [record.getMessage() for record in caplog.records]
    assert f"{HOST}:{broker.port}: messages not sent in time: 1" in said


async def test_a_restarted_broker_is_found_again(
    broker: Mosquitto, caplog: pytest.LogCaptureFixture
) -> None:
    with source_of(options(broker.options)) as source:
        async with peer(broker) as other:
            await other.publish("house/door", "ON", qos=1, retain=True)
            await until(source, lambda r: r["door"] is True)
        broker.stop()
        broker.start()
        async with peer(broker, f"{PREFIX}/world/status") as other:
            await heard(other, f"{PREFIX}/world/status", b"online")
            await other.publish("house/door", "OFF", qos=1)
            await until(source, lambda r: r["door"] is False)
    address = f"{HOST}:{broker.port}"
    said = [record.getMessage() for record in caplog.records]
    lost = [text for text in said if text.startswith(f"{address}: not connected, got")]
    assert 1 <= len(lost) <= 2  # dropped, and perhaps refused meanwhile
    assert said[-1] == f"{address}: connected"


def flood(port: int, count: int, topics: int) -> None:
    """Publish `count` messages as fast as the broker takes them, then the end of it.

    Each topic says on and off in turn; what it says last is its number's parity.
    """

    def packet(topic: str, payload: bytes) -> bytes:
        name = topic.encode()
        body = struct.pack(">H", len(name)) + name + payload
        return bytes([0x30, len(body)]) + body

    hello = b"\x00\x04MQTT\x04\x02\x00\x3c\x00\x05flood"
    rounds = [
        b"".join(
            packet(f"flood/{k}", b"ON" if (k + turn) % 2 else b"OFF")
            for k in range(topics)
        )
        for turn in range(2)
    ]
    with socket.create_connection((HOST, port)) as connection:
        connection.sendall(bytes([0x10, len(hello)]) + hello)
        assert connection.recv(4) == b"\x20\x02\x00\x00"
        for turn in range(count // topics):
            connection.sendall(rounds[turn % 2])
        # An answer to this shows that the broker has taken all before.
        connection.sendall(packet("flood/end", b"ON") + b"\xc0\x00")
        assert connection.recv(2) == b"\xd0\x00"


async def test_of_a_flood_the_latest_readings_are_left(broker: Mosquitto) -> None:
    topics, count = 20, 30_000
    sensors = [MqttSensor(name=f"s{k}", topic=f"flood/{k}") for k in range(topics)]
    end = MqttSensor(name="end", topic="flood/end")
    with source_of(options(broker.options, *sensors, end)) as source:
        async with peer(broker) as other:
            await other.publish("flood/end", "OFF", qos=1, retain=True)
            await until(source, lambda r: r["end"] is False)
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            flooding = asyncio.create_task(
                asyncio.to_thread(flood, broker.port, count, topics)
            )
            found = await until(source, lambda r: r["end"] is True)
            await flooding
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        statistics = source.statistics()
    last = count // topics - 1
    assert found == {"end": True} | {
        f"s{k}": (k + last) % 2 == 1 for k in range(topics)
    }
    assert statistics.taken == count + 2
    assert statistics.ticks + statistics.coalesced <= statistics.taken
    assert grown < 32 * 1024  # KiB; the messages alone would be more, were they kept


async def test_what_is_no_reading_is_named_once_a_second_and_the_run_goes_on(
    broker: Mosquitto, caplog: pytest.LogCaptureFixture
) -> None:
    sensor = MqttSensor(name="warm", topic="climate", field="t", on_above=20)
    with source_of(options(broker.options, sensor)) as source:
        async with peer(broker, f"{PREFIX}/world/status") as other:
            waiting = asyncio.create_task(until(source, lambda r: r["warm"] is True))
            await heard(other, f"{PREFIX}/world/status", b"online")
            for _ in range(100):
                await other.publish("climate", "it is rather warm " * 9)
            await other.publish("climate", '{"t": 21}')
            await waiting
        assert source.statistics().refused == 100
    said = [record.getMessage() for record in caplog.records]
    wrong = (
        "warm: climate: must be JSON, got 'it is rather warm it is rather warm it i'"
    )
    assert said[0] == wrong
    assert 1 <= said.count(wrong) < 5
    assert any(re.match(r"\d+ more were refused", text) for text in said)


BE_WORLD = """
import sys, msgspec
from neurosnap.sources.mqtt.options import MqttOptions
from neurosnap.sources.mqtt.mqtt_source import mqtt_source
mqtt_source(msgspec.json.decode(sys.stdin.readline(), type=MqttOptions)).first()
"""


async def test_the_last_will_speaks_for_who_is_killed(broker: Mosquitto) -> None:
    status = f"{PREFIX}/world/status"
    async with peer(broker, status) as other:
        process = subprocess.Popen(  # noqa: ASYNC220 - it returns at once
            [sys.executable, "-c", BE_WORLD], stdin=subprocess.PIPE
        )
        try:
            assert process.stdin is not None
            process.stdin.write(msgspec.json.encode(options(broker.options)) + b"\n")
            process.stdin.flush()
            await heard(other, status, b"online")
        finally:
            process.kill()
            process.communicate()
        await heard(other, status, b"offline")
    async with peer(broker, status) as other:
        assert (await heard(other, status, b"offline")).retain
