"""``neurosnap topics`` against a real Mosquitto broker, and the file it writes."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("aiomqtt")

from tests.support.command_line import call
from tests.support.mosquitto import Mosquitto, needs_mosquitto, peer, started
from tests.support.patience import PATIENCE

pytestmark = pytest.mark.slow


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    with started(tmp_path, "allow_anonymous true") as broker:
        yield broker


@needs_mosquitto
async def test_a_look_at_a_broker_counts_its_messages_and_gives_a_right_file(
    broker: Mosquitto, tmp_path: Path
) -> None:
    out = tmp_path / "home.toml"
    async with peer(broker) as other:
        for topic, payload in [
            ("home/kitchen/motion", "ON"),
            ("home/bath/motion", "OFF"),
            ("home/warm", "21.5"),
            ("zigbee2mqtt/door", '{"contact": false, "battery": 97}'),
        ]:
            await other.publish(topic, payload, qos=1, retain=True)
        command = [sys.executable, "-m", "neurosnap", "init", "topics"]
        command += [f"127.0.0.1:{broker.port}", "--seconds", "3600", "--format", "json"]
        process = subprocess.Popen(  # noqa: ASYNC220 - it returns at once
            [*command, "--out", str(out)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stderr is not None
            heard: set[str] = set()
            for line in process.stderr:
                heard |= {line.split()[-1]} if line.startswith("heard") else set()
                if len(heard) == 4:
                    break
            process.send_signal(signal.SIGINT)
            said, errors = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            process.communicate()
        assert process.returncode == 0, errors
        facts = json.loads(said.splitlines()[-1])
        assert {each["topic"]: each["messages"] for each in facts["topics"]} == (
            dict.fromkeys(heard, 1)
        )
    assert call("check", out).exit_code == 0
