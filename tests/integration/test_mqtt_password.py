"""A run whose broker is given another password while it goes on."""

import asyncio
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run import run
from neurosnap.sensorium import unpack
from tests.support.mosquitto import (
    HOST,
    Mosquitto,
    needs_mosquitto,
    peer,
    see,
    set_passwords,
    started,
)

pytestmark = [pytest.mark.slow, needs_mosquitto]

ONLINE = {"memory/status": b"online", "memory/world/status": b"online"}
OLD, NEW, OTHER = "correct-horse", "battery-staple", "somebody-else"
TEXT = """
[source]
kind = "mqtt"
sensors = [
  {{ name = "door", topic = "house/door", stale_after = 1 }},
  {{ name = "light", topic = "house/light" }},
]
[source.broker]
host = "127.0.0.1"
port = {port}
username = "neuro"
password_file = "secret"
[source.tick]
interval = 0.02
[source.publish]
prefix = "memory"
[run]
ticks = 1000000
[cells]
kind = "inline"
"""


class Watch(logging.Handler):
    """Lets a test wait until something was logged, and a tick was reached."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []
        self.tick = 0
        self._changed = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())
        self._loop.call_soon_threadsafe(self._changed.set)

    def reached(self, tick: int) -> None:
        self.tick = tick
        self._changed.set()

    async def until(self, happened: Callable[[], bool]) -> None:
        while not happened():
            self._changed.clear()
            await self._changed.wait()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    passwords = tmp_path / "passwords"
    set_passwords(passwords, neuro=OLD, other=OTHER)
    lines = ("allow_anonymous false", f"password_file {passwords}")
    with started(tmp_path, *lines) as broker:
        yield broker


async def test_a_password_changed_under_way_is_named_and_waited_for(
    broker: Mosquitto,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    caplog.set_level(logging.DEBUG)
    monkeypatch.setattr("neurosnap.sources.mqtt.connection.LONGEST", 0.5)
    passwords, secret = tmp_path / "passwords", tmp_path / "secret"
    secret.write_text(f"{OLD}\n")
    file, log = tmp_path / "house.toml", tmp_path / "house.mcap"
    file.write_text(TEXT.format(port=broker.port))
    options = prepare(load(file)).options
    stop, watch = asyncio.Event(), Watch()
    logger = logging.getLogger("neurosnap.sources.mqtt.connection")
    logger.addHandler(watch)
    async with asyncio.TaskGroup() as group:
        running = group.create_task(
            run(RunRequest(options, log), stop, Watcher(watch.reached))
        )
        try:
            async with peer(
                broker, "memory/#", username="other", password=OTHER
            ) as other:
                await see(other, {}, ONLINE)
                await other.publish("house/light", "ON", qos=1)
                await other.publish("house/door", "ON", qos=1)
                await see(other, {}, {"memory/sensor/door": b"ON"})

            broker.stop()
            set_passwords(passwords, neuro=NEW, other=OTHER)
            broker.start()
            wrong = (
                f"{HOST}:{broker.port}: not connected, got username: must be taken by"
                f" {HOST}:{broker.port}, with its password"
            )
            await watch.until(lambda: any(s.startswith(wrong) for s in watch.said))
            refused = watch.tick
            # So many ticks take longer than any reading of the door is believed.
            await watch.until(lambda: watch.tick > refused + 60)
            again = watch.tick
            assert not running.done()

            secret.write_text(f"{NEW}\n")
            async with peer(
                broker, "memory/#", username="other", password=OTHER
            ) as other:
                await see(other, {}, ONLINE)
                await other.publish("house/door", "OFF", qos=1)
                await see(other, {}, {"memory/sensor/door": b"OFF"})
        finally:
            stop.set()
            logger.removeHandler(watch)
    assert any("got 'neuro'; trying again until" in each for each in watch.said)
    # Once for who listens and once for who tells, however often they tried.
    assert 1 <= sum(each.startswith(wrong) for each in watch.said) <= 2
    assert watch.said.count(f"{HOST}:{broker.port}: connected") >= 2

    recording = Recording.open(log)
    known = {
        each.message.tick: unpack(each.message.known or b"\x03", 2).tolist()
        for each in recording.messages(("observation",))
        if isinstance(each.message, wire.Observation)
    }
    # It went on through all of that: the door unknown, the light believed as ever.
    assert list(known) == list(range(1, len(known) + 1))
    assert known[again] == [False, True]
    assert all(known[tick][1] for tick in range(refused, len(known) + 1))
    assert any(known[tick] == [True, True] for tick in known if tick > again)
    assert verify(log).same
    raw = caplog.text + "".join(recording.metadata.values())
    assert not any(word in raw for word in (OLD, NEW))
