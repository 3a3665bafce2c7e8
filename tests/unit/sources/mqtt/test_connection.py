"""An MQTT link reconnects and resends when its connection breaks."""

import asyncio
import logging
from collections.abc import AsyncIterator
from typing import Any, Self

import pytest

pytest.importorskip("aiomqtt")

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.mqtt.connection import (
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

    async def subscribe(self, filters: list[tuple[str, int]]) -> list[int]:
        return [1] * len(filters)

    async def publish(
        self, topic: str, payload: bytes, *, qos: int, retain: bool
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
