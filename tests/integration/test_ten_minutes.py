"""The page "your own sensors, in ten minutes": its commands, in its order."""

import re
import shlex
import shutil
import signal
from pathlib import Path

import aiomqtt
import pytest

pytest.importorskip("aiomqtt")

from tests.support.mosquitto import needs_mosquitto, peer, see, started
from tests.support.view_commands import Verb, done, verb

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "ten_minutes.md").read_text()
DATABASE = ROOT / "tests" / "golden" / "home-assistant_v2.db"
BLOCKS = re.findall(r"^```console\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
COMMANDS = re.findall(r"^\$ neurosnap (.*)$", "".join(BLOCKS), re.MULTILINE)
LEARN = [line for line in COMMANDS if line.startswith("learn ")]
BROKER = [line for line in COMMANDS if line not in LEARN]
SHOWN = {
    command: output.splitlines()
    for block in BLOCKS
    for command, output in re.findall(
        r"^\$ neurosnap (.*)\n((?:[^$].*\n)+)", block, re.MULTILINE
    )
}
(LINE,) = re.findall(r"^tick \d+: .*$", PAGE, re.MULTILINE)
DOOR, HALL = "zigbee2mqtt/front_door", "zigbee2mqtt/hall"
BELIEVED = "neurosnap/sensor/front_door_contact", "neurosnap/sensor/hall_occupancy"
WALKS = 12  # as the page has it


def without_ticks(line: str) -> str:
    """Return a line without what depends on when messages come."""
    return re.sub(r"tick \d+", "tick N", line)


def test_the_page_has_the_commands_that_are_run_here() -> None:
    assert len(LEARN) == 3
    verbs = [line.split()[0] for line in BROKER]
    assert verbs == ["init", "check", "run", "watch", "watch", "verify"]
    assert list(SHOWN) == LEARN[:1]


@pytest.mark.parametrize("line", LEARN)
async def test_a_database_gives_a_table(tmp_path: Path, line: str) -> None:
    shutil.copy(DATABASE, tmp_path)
    said = await done(tmp_path, line)
    for shown in SHOWN.get(line, []):
        assert shown.rstrip() in said
    assert "relation" in "".join(said) or (tmp_path / "home.html").is_file()


async def looked(process: Verb) -> None:
    """Let a look at a broker end once it has heard of both devices, once each."""
    heard: set[bytes] = set()
    while len(heard) < 2:
        line = await process.stderr.readline()
        assert line, heard
        heard |= {line.split()[-1]} if line.startswith(b"heard") else set()
    process.send_signal(signal.SIGINT)
    output, errors = await process.communicate()
    assert process.returncode == 0, errors.decode()
    rows = [line.split()[:2] for line in output.decode().splitlines()]
    assert [row for row in rows if row[0] in (DOOR, HALL)] == [[DOOR, "1"], [HALL, "1"]]


@needs_mosquitto
async def test_a_broker_gives_the_first_anomaly(tmp_path: Path) -> None:
    topics, check, run, watch, *after = BROKER
    seen: dict[str, bytes] = {}

    async def show(client: aiomqtt.Client, door: bool, hall: bool) -> None:
        """Let the devices say what they see, and wait until it had its tick."""
        contact, occupancy = (str(on).lower() for on in (not door, hall))
        for topic, payload in (
            (DOOR, f'{{"contact": {contact}, "battery": 97}}'),
            (HALL, f'{{"occupancy": {occupancy}, "battery": 80}}'),
        ):
            await client.publish(topic, payload, qos=1, retain=True)
        words = (b"ON" if on else b"OFF" for on in (door, hall))
        await see(client, seen, dict(zip(BELIEVED, words, strict=True)))

    with started(tmp_path, "allow_anonymous true") as broker:
        address = f"127.0.0.1:{broker.port}"
        async with peer(broker, "neurosnap/#") as home:
            first = {DOOR: '{"contact": true}', HALL: '{"occupancy": false}'}
            for topic, payload in first.items():
                await home.publish(topic, payload, qos=1, retain=True)
            line = topics.replace("localhost", address)
            async with verb(tmp_path, *shlex.split(line)) as process:
                await looked(process)
            await done(tmp_path, check)
            # A reader's door is slower than this one.
            file = tmp_path / "home.toml"
            text = file.read_text()
            assert "min_interval = 0.5" in text
            file.write_text(text.replace("min_interval = 0.5", "min_interval = 0"))
            async with verb(tmp_path, *shlex.split(run)) as process:
                wanted = {"neurosnap/world/status": b"online"}
                await see(home, seen, wanted | dict.fromkeys(BELIEVED, b"OFF"))
                async with verb(tmp_path, *shlex.split(watch)) as watching:
                    assert b"watching" in await watching.stderr.readline()
                    for _ in range(WALKS):
                        for door, hall in (0, 1), (1, 1), (0, 1), (0, 0):
                            await show(home, bool(door), bool(hall))
                    await show(home, door=True, hall=False)
                    told = (await watching.stdout.readline()).decode().strip()
                    assert without_ticks(told) == without_ticks(LINE)
                    process.send_signal(signal.SIGINT)
                    _, errors = await process.communicate()
                    assert process.returncode == 0, errors.decode()
                    _, errors = await watching.communicate()
                    assert watching.returncode == 0, errors.decode()
    again, verified = [await done(tmp_path, line) for line in after]
    assert told in again
    assert any(line.startswith("same:") for line in verified)
