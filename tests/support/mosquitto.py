"""A Mosquitto broker started per test, and its clients."""

import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import aiomqtt
import pytest

from neurosnap.sources.mqtt.options import MqttBroker
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.programs import find, needs

HOST = "127.0.0.1"
PROGRAM = find("mosquitto")
needs_mosquitto = needs("mosquitto")


class Mosquitto:
    """The broker, to be started and stopped on one port."""

    def __init__(self, folder: Path, *lines: str) -> None:
        self.port = free_port()
        self._file = folder / "mosquitto.conf"
        # As root it would become a user who may not read the test's files.
        text = (
            f"listener {self.port} {HOST}",
            "user root",
            "log_type information",
            *lines,
        )
        self._file.write_text("\n".join(text) + "\n")
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it, and return once it listens."""
        assert PROGRAM is not None
        self._process = subprocess.Popen(
            [PROGRAM, "-c", str(self._file)], stderr=subprocess.PIPE, text=True
        )
        assert self._process.stderr is not None
        said = []
        for line in self._process.stderr:
            said.append(line)
            if "running" in line:
                return
        pytest.fail(f"mosquitto did not start: {said}")

    def stop(self) -> None:
        """Stop it; it forgets everything."""
        if self._process is not None:
            self._process.terminate()
            self._process.communicate(timeout=PATIENCE)
            self._process = None

    @property
    def options(self) -> MqttBroker:
        """How to connect to it."""
        return MqttBroker(host=HOST, port=self.port, patience=5)


@contextmanager
def started(folder: Path, *lines: str) -> Iterator[Mosquitto]:
    broker = Mosquitto(folder, *lines)
    try:
        broker.start()
        yield broker
    finally:
        broker.stop()


def set_passwords(file: Path, **passwords: str) -> None:
    """Write who may connect; a broker reads that when it starts."""
    file.write_text("")
    for user, password in passwords.items():
        subprocess.run(
            ["mosquitto_passwd", "-b", str(file), user, password], check=True
        )


@asynccontextmanager
async def peer(
    broker: Mosquitto,
    *topics: str,
    username: str | None = None,
    password: str | None = None,
) -> AsyncIterator[aiomqtt.Client]:
    """Another client of the same broker, which listens to `topics`."""
    async with aiomqtt.Client(
        HOST, broker.port, username=username, password=password
    ) as client:
        for topic in topics:
            await client.subscribe(topic, qos=1)
        yield client


async def heard(client: aiomqtt.Client, topic: str, payload: bytes) -> aiomqtt.Message:
    """Wait until `topic` says `payload`."""
    async for message in client.messages:
        if message.topic.value == topic and message.payload == payload:
            return message
    raise AssertionError("the connection ended")


async def see(
    client: aiomqtt.Client, seen: dict[str, bytes], wanted: dict[str, bytes]
) -> None:
    """Take down what topics say until all say what is wanted."""
    while wanted.items() - seen.items():
        message = await anext(aiter(client.messages))
        seen[message.topic.value] = bytes(message.payload)


async def left(broker: Mosquitto) -> dict[str, bytes]:
    """All that the broker retains."""
    async with peer(broker, "#") as other:
        # Its own comes after all that was retained.
        await other.publish("mark", b"", qos=1)
        found = {}
        async for message in other.messages:
            if not message.retain:
                break
            found[message.topic.value] = message.payload
    return found
