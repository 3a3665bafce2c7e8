"""An MQTT link reconnects and resends when its connection breaks."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any, Self

import pytest

pytest.importorskip("aiomqtt")

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.mqtt.connection import (
    _ANSWER,
    LONGEST,
    SHORTEST,
    MqttLink,
    delay_after,
    give_up,
    is_refusal,
)
from neurosnap.sources.mqtt.options import MqttBroker
from neurosnap.sources.mqtt.outbox import Outgoing


def refusal(text: str) -> aiomqtt.MqttCodeError:
    return aiomqtt.MqttCodeError(ReasonCode(PacketTypes.CONNACK, text))


class Connection:
    """Stands in for one connection; a broker that keeps silent, fails, or answers."""

    def __init__(
        self,
        *,
        silent: tuple[str, ...] = (),
        fails: str = "",
        refuses: aiomqtt.MqttError | None = None,
    ) -> None:
        self.pending_calls_threshold = 0
        self.got: list[str] = []
        self.answer = asyncio.Event()
        self._silent = silent
        self._fails = fails
        self._refuses = refuses
        self._more = asyncio.Condition()

    async def __aenter__(self) -> Self:
        if self._refuses is not None:
            raise self._refuses
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    @property
    async def messages(self) -> AsyncIterator[None]:
        await asyncio.Event().wait()
        yield

    async def subscribe(self, filters: list[tuple[str, int]], **_: object) -> list[int]:
        return [1] * len(filters)

    async def publish(
        self, topic: str, payload: bytes, *, qos: int, retain: bool, **_: object
    ) -> None:
        assert self.pending_calls_threshold
        self.got.append(topic)
        async with self._more:
            self._more.notify_all()
        if topic == self._fails:
            raise aiomqtt.MqttError("connection lost")
        if topic in self._silent:
            await self.answer.wait()

    async def wait_for(self, count: int) -> None:
        async with self._more:
            await self._more.wait_for(lambda: len(self.got) >= count)


def link_over(
    monkeypatch: pytest.MonkeyPatch, *connections: Connection, **more: Any
) -> MqttLink:
    following = iter(connections)
    monkeypatch.setattr(MqttLink, "_client", lambda _: next(following))
    monkeypatch.setattr("neurosnap.sources.mqtt.connection.SHORTEST", 0.0)
    return MqttLink(MqttBroker(), "test", **{"filters": ["door"], **more})


async def serve_until(link: MqttLink, connection: Connection, count: int) -> None:
    """Let a link serve until a connection has got so many messages."""
    stop = asyncio.Event()
    async with asyncio.TaskGroup() as group:
        group.create_task(link.serve(stop))
        await connection.wait_for(count)
        stop.set()


async def test_what_is_on_its_way_at_the_end_is_not_sent_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    connection = Connection(silent=("toggle",))
    link, stop = link_over(monkeypatch, connection), asyncio.Event()
    link.send(Outgoing("toggle", b"1"))
    async with asyncio.TaskGroup() as group:
        group.create_task(link.serve(stop))
        await connection.wait_for(1)
        link.send(Outgoing("other", b"1"))
        stop.set()
        for _ in range(10):
            await asyncio.sleep(0)  # whoever is told to end is about it
        connection.answer.set()
    assert connection.got == ["toggle", "other"]


async def test_of_a_broken_batch_what_arrived_is_not_sent_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = Connection(silent=("again",), fails="bad")
    second = Connection()
    link = link_over(monkeypatch, first, second)
    for topic in ("done", "again", "bad"):
        link.send(Outgoing(topic, b"1"))
    await serve_until(link, second, 2)
    assert first.got == ["done", "again", "bad"]
    assert second.got == ["again", "bad"]


# What takes long ----------------------------------------------------------------------

CONNECT, CONNACK, PUBLISH, PUBACK, SUBSCRIBE, SUBACK, DISCONNECT = 1, 2, 3, 4, 8, 9, 14
"""Packets of MQTT 5."""


class Scripted:
    """A broker on a socket that says what a test wants, and a link to it.

    Time is what the test says: only `pass_time` moves the clock of the event loop.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        loop = asyncio.get_running_loop()
        self._now = loop.time()
        monkeypatch.setattr(loop, "time", lambda: self._now)
        self._clients: asyncio.Queue[
            tuple[asyncio.StreamReader, asyncio.StreamWriter]
        ] = asyncio.Queue()
        self.heard: list[bytes | bool] = []
        """What the link was told: payloads, and whether it listens."""
        self.stop = asyncio.Event()

    async def pass_time(self, seconds: float) -> None:
        self._now += seconds
        for _ in range(10):
            await asyncio.sleep(0)  # who waits for that time goes on

    @asynccontextmanager
    async def linked(self) -> AsyncIterator[MqttLink]:
        """Serve a link that has a session, and subscribes to ``door``."""
        accept = partial(asyncio.start_server, host="127.0.0.1", port=0)
        async with await accept(lambda *ends: self._clients.put_nowait(ends)) as server:
            link = MqttLink(
                MqttBroker(host="127.0.0.1", port=server.sockets[0].getsockname()[1]),
                "test",
                filters=["door"],
                status="status",
                receive=lambda _, payload, __: self.heard.append(payload),
                connected=self.heard.append,
                session="0123456789abcdef",
            )
            async with asyncio.TaskGroup() as group:
                group.create_task(link.serve(self.stop))
                yield link
                self.stop.set()

    async def subscribed_to(self) -> bytes:
        """Let a link in that then subscribes; return the number of its packet."""
        self._reader, self._writer = await self._clients.get()
        await self.got(CONNECT)
        self.say(CONNACK, b"\1\0\0")
        return (await self.got(SUBSCRIBE))[:2]

    def say(self, kind: int, body: bytes) -> None:
        flags = 2 * (kind == PUBLISH)  # QoS 1
        self._writer.write(bytes([kind << 4 | flags, len(body)]) + body)

    async def got(self, kind: int) -> bytes:
        """Return the next packet that came, which must be of a kind."""
        first, length = await self._reader.readexactly(2)
        assert (first >> 4, length < 128) == (kind, True)
        return await self._reader.readexactly(length)

    async def publish(self, *numbers: int) -> None:
        """Publish numbers, and wait until each is acknowledged."""
        for number in numbers:
            self.say(PUBLISH, b"\0\4door" + bytes([0, number, 0, number]))
        for number in numbers:
            assert (await self.got(PUBACK))[:2] == bytes([0, number])

    async def end(self) -> None:
        """Wait for the end of the connection, and end it."""
        assert await self._reader.read() == b""
        self._writer.close()
        await self._writer.wait_closed()


@pytest.fixture
async def scripted(monkeypatch: pytest.MonkeyPatch) -> Scripted:
    return Scripted(monkeypatch)


async def test_what_a_broker_kept_may_take_long_to_come_before_its_answer(
    scripted: Scripted,
) -> None:
    async with scripted.linked():
        wanted = await scripted.subscribed_to()
        for first in (1, 11, 21):
            await scripted.publish(*range(first, first + 10))
            await scripted.pass_time(_ANSWER + 1)
        assert scripted.heard == [True, *(bytes([n]) for n in range(1, 31))]
        scripted.say(SUBACK, wanted + b"\0\1")
        online = await scripted.got(PUBLISH)
        # So it may before any other answer.
        await scripted.publish(31)
        await scripted.pass_time(_ANSWER + 1)
        await scripted.publish(32)
        scripted.say(PUBACK, online[8:10])
        scripted.stop.set()
        offline = await scripted.got(PUBLISH)
        assert (online[-6:], offline[-7:]) == (b"online", b"offline")
        scripted.say(PUBACK, offline[8:10])
        await scripted.got(DISCONNECT)
        await scripted.end()
    heard = [payload for payload in scripted.heard if isinstance(payload, bytes)]
    assert heard == [bytes([number]) for number in range(1, 33)]


async def test_a_broker_that_falls_silent_is_given_up_and_that_is_said(
    scripted: Scripted, caplog: pytest.LogCaptureFixture
) -> None:
    async with scripted.linked():
        await scripted.subscribed_to()
        await scripted.publish(1)
        for _ in range(2):  # in the first something came
            assert not caplog.messages
            await scripted.pass_time(_ANSWER + 1)
        await scripted.got(DISCONNECT)
        await scripted.end()
        scripted.stop.set()
    (said,) = caplog.messages
    assert "not connected, got Operation timed out; trying again" in said
    assert scripted.heard == [True, b"\1", False]


async def test_who_is_stopped_while_a_broker_owes_an_answer_does_not_wait_for_it(
    scripted: Scripted,
) -> None:
    async with scripted.linked() as link:
        await scripted.subscribed_to()
        await scripted.publish(1)
        link.forget()
        scripted.stop.set()
        # It says that nothing is to be kept, and not that it leaves: it never came.
        assert await scripted.got(DISCONNECT) == b"\0\5\x11" + bytes(4)
        await scripted.end()
    assert scripted.heard == [True, b"\1", False]


# What is said -------------------------------------------------------------------------


@pytest.mark.parametrize("filters", [["door"], []])
async def test_a_lost_broker_is_said_with_how_long_it_will_be_tried(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    filters: list[str],
) -> None:
    """A link that only publishes leaves it to the run's other one."""
    caplog.set_level(logging.WARNING)
    again = Connection()
    link = link_over(monkeypatch, Connection(fails="bad"), again, filters=filters)
    link.send(Outgoing("bad", b"1"))
    await serve_until(link, again, 1)
    said = [
        "localhost:1883: not connected, got connection lost;"
        " trying again until the run ends, every 30 s at the latest",
        "localhost:1883: connected",
    ]
    assert caplog.messages == (said if filters else [])


async def test_a_password_changed_under_way_is_named_once_and_waited_for(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("neurosnap.sources.mqtt.connection.LONGEST", 0.0)
    refused = [Connection(refuses=refusal("Not authorized")) for _ in range(5)]
    last = Connection()
    link = link_over(monkeypatch, Connection(fails="bad"), *refused, last)
    link.send(Outgoing("bad", b"1"))
    await serve_until(link, last, 1)
    lost, named, again = caplog.messages
    assert "got connection lost; trying again until the run ends" in lost
    assert "got username: must be taken by localhost:1883, with its passwo" in named
    assert again == "localhost:1883: connected"


async def test_a_broker_without_mqtt_5_is_not_asked_to_keep_anything(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    old = Connection(refuses=refusal("Unsupported protocol version"))
    again = Connection()
    link = link_over(monkeypatch, old, again, session="0123456789abcdef")
    link.hold("door", b"1")
    await serve_until(link, again, 1)
    assert link._known_as == ""
    (said,) = caplog.messages
    assert said.startswith("localhost:1883: speaks no MQTT 5, so it keeps nothing of")


# When to try again --------------------------------------------------------------------

BROKER = MqttBroker(host="house", username="neuro", password_env="P", patience=3)
GONE = aiomqtt.MqttError("gone")


def test_delays_double_up_to_the_longest_and_a_lasting_connection_starts_over() -> None:
    delay, delays = 0.0, []
    for _ in range(9):
        delays.append(delay := delay_after(delay, GONE, lasted=1.0))
    assert delays == [min(SHORTEST * 2**attempt, LONGEST) for attempt in range(9)]
    assert delay_after(LONGEST, GONE, lasted=LONGEST) == LONGEST
    assert delay_after(LONGEST, GONE, lasted=LONGEST + 1) == SHORTEST


def test_a_refusal_is_not_asked_again_in_haste_and_ends_a_start_at_once() -> None:
    rule = r"^username: must be taken by house:1883, with its password .*'neuro'$"
    for text in ("Bad user name or password", "Not authorized"):
        assert delay_after(0.0, refusal(text), lasted=0.1) == LONGEST
        with pytest.raises(InvalidValueError, match=rule):
            give_up(BROKER, refusal(text), late=False)
    # A number of the client library is no refusal.
    assert not is_refusal(aiomqtt.MqttCodeError(5))
    assert not is_refusal(refusal("Server busy"))


def test_anything_else_ends_a_start_when_the_patience_is_over() -> None:
    give_up(BROKER, GONE, late=False)
    with pytest.raises(
        NeurosnapError,
        match=r"^broker: must answer within 3 s, got nothing from house:1883 \(gone\)$",
    ):
        give_up(BROKER, GONE, late=True)
