"""Sources and publishers on a real Mosquitto, which every test starts for itself.

Nothing waits for a time: a broker is there once it says so, a client once its status
topic says ``online``, and readings show in ticks.
"""

import asyncio
import logging
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, nullcontext
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.fabric.certificates import make_keys
from neurosnap.sensorium import pack
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.mqtt.mqtt_source import MqttFeeder, mqtt_source
from neurosnap.sources.mqtt.options import (
    MqttAction,
    MqttBroker,
    MqttOptions,
    MqttPublish,
    MqttSensor,
    MqttTick,
)
from neurosnap.sources.mqtt.publisher import MqttPublisher
from tests.support.mosquitto import (
    HOST,
    Mosquitto,
    heard,
    left,
    needs_mosquitto,
    peer,
    started,
)
from tests.support.ports import free_port
from tests.support.sources import readings

pytestmark = [pytest.mark.slow, needs_mosquitto]

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


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    with started(tmp_path, "allow_anonymous true") as broker:
        yield broker


async def test_what_the_broker_kept_is_the_first_reading(broker: Mosquitto) -> None:
    sensors = (
        MqttSensor(name="door", topic="house/hall/door"),
        MqttSensor(name="warm", topic="house/climate", field="t", when="> 20"),
        MqttSensor(name="phone", topic="house/hall/door", when="heard within 60 s"),
    )
    async with peer(broker) as other:
        await other.publish("house/hall/door", "OPEN", qos=1, retain=True)
        await other.publish("house/climate", '{"t": 19.5}', qos=1, retain=True)
        with source_of(options(broker.options, *sensors)) as source:
            found = await until(source, lambda r: None not in (r["door"], r["warm"]))
            # Nobody knows when what was kept was said: it is no sign of life.
            assert found == {"door": True, "warm": False, "phone": None}
            await other.publish("house/hall/door", "closed", qos=1)
            found = await until(source, lambda r: r["phone"] is not None)
            assert found == {"door": False, "warm": False, "phone": True}


async def test_a_broker_drops_nothing_for_a_run_that_is_behind(
    broker: Mosquitto, tmp_path: Path
) -> None:
    """As it does of more than 1,000 messages that it has to queue."""
    sensors = [MqttSensor(name=name, topic=f"house/{name}") for name in ("door", "end")]
    table, journal = (
        options(broker.options, *sensors),
        Journal(tmp_path, ["door", "end"]),
    )
    async with peer(broker, f"{PREFIX}/world/status") as other:
        with closing(mqtt_source(table, journal=journal)) as source:
            source.resume_after(0)
            source._start()
            await heard(other, f"{PREFIX}/world/status", b"online")
            with source._condition:  # so that it receives nothing meanwhile
                for number in range(3000):
                    word = "ON" if number % 2 else "OFF"
                    await other.publish("house/door", word, qos=1)
            await other.publish("house/end", "ON", qos=1)
            await until(source, lambda r: r["end"] is True)
            assert source.statistics().received.total == 3001


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
            assert await asyncio.to_thread(source.first) is not None
            for choice, word in ((2, "OFF"), (0, "ON"), (1, "OFF")):
                await other.publish("house/door", word)
                await asyncio.to_thread(source.step, choice)
            got = [await anext(other.messages) for _ in range(2)]
    assert [(m.topic.value, m.payload) for m in got] == [
        ("house/bell", b"ring"),
        ("house/light/set", b"ON"),
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


# What a run publishes -----------------------------------------------------------------


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
        stop.set()
    found = await left(broker)
    assert sum(topic.startswith("homeassistant/") for topic in found) == 1


# Connecting ---------------------------------------------------------------------------


async def refused(broker: MqttBroker, why: str) -> None:
    """Check that a source does not start with a broker, and why."""
    with source_of(options(broker)) as one, pytest.raises(NeurosnapError, match=why):
        await asyncio.to_thread(one.first)


# The library does not close the socket of a failed handshake, and Python says so.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_with_tls_only_a_broker_that_is_trusted_is_spoken_to(
    tmp_path: Path,
) -> None:
    keys = make_keys(tmp_path / "keys", [HOST]).folder
    files = (f"certfile {keys}/hub.pem", f"keyfile {keys}/hub.key")
    with started(tmp_path, "allow_anonymous true", *files) as broker:
        trusting = msgspec.structs.replace(
            broker.options, tls=True, ca_file=f"{keys}/ca.pem"
        )
        sensor = MqttSensor(name="up", topic=f"{PREFIX}/world/status")
        with source_of(options(trusting, sensor)) as source:
            await until(source, lambda r: r["up"] is True)
        blind = msgspec.structs.replace(broker.options, tls=True)
        await refused(blind, r"^broker: must have .* that is trusted \(.*verify fa")
    nothing = msgspec.structs.replace(trusting, ca_file=str(tmp_path / "none.pem"))
    with pytest.raises(
        InvalidValueError, match=r"^ca_file: must be PEM .*No such file"
    ):
        mqtt_source(options(nothing))


@pytest.mark.parametrize("host", [HOST, "no-such-host.invalid"])
async def test_a_broker_that_is_not_there_ends_the_start_when_the_patience_is_over(
    tmp_path: Path, host: str
) -> None:
    port = Mosquitto(tmp_path).port
    gone = MqttBroker(host=host, port=port, patience=0.1)
    rule = rf"^broker: must answer within 0.1 s, got nothing from {host}:{port} "
    await refused(gone, rule)


async def test_a_broker_that_says_nothing_ends_the_start_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.sources.mqtt.connection._ANSWER", 0.2)
    with closing(socket.create_server((HOST, 0))) as mute:
        port = mute.getsockname()[1]
        broker = MqttBroker(host=HOST, port=port, patience=0.1)
        await refused(broker, r"\(Operation timed out\)$")


async def test_an_intake_that_follows_another_waits_for_its_broker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as the run would, though it has not connected yet."""
    gone = MqttBroker(host=HOST, port=free_port(), patience=0.001)
    Journal(tmp_path, ["door"]).close()
    for deaf in ("", "intake: killed"):
        feeder = MqttFeeder(options(gone), Journal(tmp_path, ["door"], deaf))
        stop = asyncio.Event()
        if deaf:  # it would try for ever
            monkeypatch.setattr(feeder._link, "_log_trouble", lambda _, s=stop: s.set())
        gives_up = pytest.raises(NeurosnapError, match="must answer within")
        with nullcontext() if deaf else gives_up:
            await feeder._link.serve(stop)
        assert stop.is_set() == bool(deaf)


async def test_who_is_stopped_while_connecting_does_not_fail_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.sources.mqtt.connection._ANSWER", 0.2)
    stop = asyncio.Event()
    with closing(socket.create_server((HOST, 0))) as mute:
        broker = MqttBroker(host=HOST, port=mute.getsockname()[1], patience=0.1)
        outlet = MqttPublisher(broker, MqttPublish(), ["door"])
        serving = asyncio.create_task(outlet.serve(stop))
        connection, _ = await asyncio.to_thread(mute.accept)
        stop.set()
        await serving
        connection.close()


async def test_a_source_can_be_closed_while_it_looks_for_its_broker(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    failed = threading.Event()

    class Watch(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            failed.set()

    gone = MqttBroker(host=HOST, port=Mosquitto(tmp_path).port, patience=3600)
    logger = logging.getLogger("neurosnap.sources.mqtt.connection")
    watch = Watch()
    logger.addHandler(watch)
    try:
        source = mqtt_source(options(gone))
        waiting = asyncio.create_task(asyncio.to_thread(source.first))
        await asyncio.to_thread(failed.wait)
        await asyncio.to_thread(source.close)
        assert await waiting is None
    finally:
        logger.removeHandler(watch)
