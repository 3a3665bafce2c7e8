"""``neurosnap run`` on an MQTT broker: learning, anomalies, actions and uptime."""

import asyncio
import json
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import aiomqtt
import psutil
import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.commands import Command
from tests.support.mosquitto import (
    HOST,
    Mosquitto,
    heard,
    needs_mosquitto,
    peer,
    see,
    set_passwords,
    started,
)
from tests.support.patience import PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.zenoh, needs_mosquitto]

SECRET = "correct-horse-battery"
ROOM = "house/room"
TEXT = """
[source]
kind = "mqtt"
sensors = [
  {{ name = "door", topic = "house/room", field = "door" }},
  {{ name = "light", topic = "house/room", field = "light" }},
  {{ name = "cold", topic = "house/room", field = "t", when = "< 19, off > 20" }},
]
actions = [{{ name = "ring", topic = "house/bell", payload = "now" }}]
[source.broker]
host = "127.0.0.1"
port = {port}
username = "neurosnap"
password_env = "HOUSE_PASSWORD"
[source.tick]
min_interval = 0
[source.publish]
prefix = "memory"
[snapshot]
threshold = 0.1
[cells]
kind = "{cells}"
workers = 1
"""


class Running:
    """A run of its own process, and what it said once it has ended."""

    def __init__(self, command: Command, log: Path) -> None:
        self.log = log
        self.said = ""
        self._command = command

    def has(self, who: str) -> bool:
        """Return whether a process of that name is below it."""
        family = psutil.Process(self._command.pid).children(recursive=True)
        return who in [one.name() for one in family]

    async def ended(self) -> int:
        """Wait for its end; return how it ended."""
        output, errors = await asyncio.to_thread(self._command.communicate, PATIENCE)
        self.said = output + errors
        return self._command.wait(PATIENCE)

    async def end(self) -> int:
        """Ask it to end; return how it did."""
        self._command.send_signal(signal.SIGTERM)
        return await self.ended()


@asynccontextmanager
async def running(
    folder: Path, broker: Mosquitto, cells: str, *flags: str
) -> AsyncIterator[Running]:
    file, log = folder / "house.toml", folder / "house.mcap"
    file.write_text(TEXT.format(port=broker.port, cells=cells), encoding="utf-8")
    environment = {"HOUSE_PASSWORD": SECRET, "PATH": "", "HOME": str(Path.home())}
    with Command(
        "run", file, "--out", log, *flags, folder=folder, environment=environment
    ) as command:
        yield Running(command, log)


async def publish(client: aiomqtt.Client, **readings: object) -> None:
    await client.publish(ROOM, json.dumps(readings), qos=1)


async def until(client: aiomqtt.Client, topic: str, **wanted: object) -> object:
    """Wait until the JSON on a topic has what is wanted in it."""
    async for message in client.messages:
        if message.topic.value == topic:
            found = json.loads(bytes(message.payload))
            if wanted.items() <= found.items():
                return found
    raise AssertionError("the connection ended")


@pytest.mark.parametrize("cells", ["process", "inline"])
async def test_a_house_is_learned_and_looked_after(tmp_path: Path, cells: str) -> None:
    with started(tmp_path, "allow_anonymous true") as broker:
        async with (
            peer(broker, "memory/#", "house/bell", "homeassistant/#") as other,
            running(tmp_path, broker, cells) as run,
        ):
            seen: dict[str, bytes] = {}
            await see(other, seen, {"memory/world/status": b"online"})
            for turn in range(60):
                door = turn % 3 == 0
                light = door or turn % 5 == 0
                await publish(other, door=door, light=light, t=15 + turn % 2 * 10)
                # What is believed says that the tick is over.
                wanted = {
                    "memory/sensor/door": b"ON" if door else b"OFF",
                    "memory/sensor/light": b"ON" if light else b"OFF",
                    "memory/sensor/cold": b"OFF" if turn % 2 else b"ON",
                }
                await see(other, seen, wanted)
            assert seen["house/bell"] == b"now"
            # What goes on reading when a part of the swarm dies; see test_kept.py.
            assert run.has("intake") == (cells == "process")
            (device,) = [t for t in seen if t.startswith("homeassistant/device/")]
            assert b"door" in seen[device]

            await other.publish(ROOM, "no reading at all", qos=1)
            await publish(other, door=True, light=None, t=15)
            await see(other, seen, {"memory/sensor/light": b"ON"})
            await publish(other, door=True, light=False, t=15)
            found = await until(other, "memory/anomaly", now="ON")
            assert isinstance(found, dict)
            assert set(found["last"]["candidates"]) == {"door", "light"}
            (broken,) = found["last"]["broken"]
            assert broken["implication"] == "door -> light"
            assert broken["against"] == 0 < broken["support"]
            await publish(other, door=True, light=True, t=25)
            await until(other, "memory/anomaly", now="OFF")

            assert await run.end() == 0, run.said
            await heard(other, "memory/status", b"offline")
    verdict = verify(run.log)
    assert verdict.same, verdict.difference
    assert verdict.complete
    assert "door: house/room: must be JSON, got 'no reading at all'" in run.said
    assert SECRET not in run.said
    raw = "".join(Recording.open(run.log).metadata.values())
    assert "HOUSE_PASSWORD" not in raw
    assert SECRET not in raw


async def test_a_wrong_password_is_named_at_once(tmp_path: Path) -> None:
    passwords = tmp_path / "passwords"
    set_passwords(passwords, neurosnap="another")
    lines = ("allow_anonymous false", f"password_file {passwords}")
    with started(tmp_path, *lines) as broker:
        async with running(
            tmp_path, broker, "inline", "--set", "supervision.max_restarts=0"
        ) as run:
            assert await run.ended() == 1
    assert f"username: must be taken by {HOST}:{broker.port}" in run.said
    assert "got 'neurosnap'" in run.said
    assert "Traceback" not in run.said
    assert SECRET not in run.said
