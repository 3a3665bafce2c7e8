"""A swarm under mutual TLS: its parts work as ever, and its recording plays.

The hub is a process of its own, as in a run, and traces its decisions: whatever it
refuses is in what it said on its standard error.
"""

import asyncio
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.security.endpoint import HubAddress
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys
from neurosnap.fabric.security.roles import RIGHTS, Role
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.playback import Playing, play_on
from neurosnap.recording.write.writer import Writer
from tests.support.fabrics import Seen
from tests.support.patience import PATIENCE
from tests.support.secured_hub import SWARM, Noted, hub_with
from tests.support.secured_swarm import TICKS, options, run_swarm
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("security") / "keys"
    make_keys(folder)
    return folder


# A swarm ------------------------------------------------------------------------------


# What the table allows and this run need not do: nothing goes wrong, no sensor looks
# back at a state, none is read outside or grown, no cells share a worker, nor workers
# the learning, no key-frame is large, and nothing is drawn.
UNSAID = {
    "coordinator": {
        "fault",
        "workerwiring",
        "anomaly",
        "recall",
        "reminder",
        "band",
        "learn",
    },
    "cell": {"fault", "recalled"},
    "world": {"fault", "image"},
    "recorder": {"fault"},
}
UNHEARD = {
    "coordinator": {"workerreport", "recalled", "learned"},
    "cell": {"recall", "reminder"},
    "world": {"state", "reading"},
}


async def test_a_swarm_runs_and_does_what_the_table_says(
    keys: Path, tmp_path: Path
) -> None:
    Noted.forget()
    with hub_with(keys) as hub:
        balance = await run_swarm(hub, options(), tmp_path / "log.mcap")
    assert balance.whole, balance
    assert hub.refused == []
    recording = Recording.open(tmp_path / "log.mcap")
    states = [m for m in recording.messages() if isinstance(m.message, wire.State)]
    assert len(states) == TICKS
    parts: tuple[Role, ...] = ("coordinator", "world", "recorder", "cell")
    for role in parts:
        rights = RIGHTS[role]
        may = set(rights.publishes)
        assert may - UNSAID.get(role, set()) <= Noted.published[role] <= may
        may = {"**"} if role == "recorder" else set(rights.reads)
        assert may - UNHEARD.get(role, set()) <= Noted.read[role] <= may
        assert (role in Noted.watched) == rights.watches
        assert bool(Noted.announced[role]) == rights.announces


# Playing back, and the command line ---------------------------------------------------


async def test_a_recording_plays_to_who_has_a_certificate(
    keys: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    with hub_with(keys) as hub:
        await run_swarm(hub, options(), log)
    recording = Recording.open(log)
    heard, seen, stop = Heard(), Seen(), asyncio.Event()
    connected = asyncio.Event()

    async def begin() -> None:
        await connected.wait()

    endpoint = hub.endpoint.replace("127.0.0.1", "0.0.0.0")
    credentials = read_credentials(keys, "hub")
    async with asyncio.TaskGroup() as group:
        playing = group.create_task(
            play_on(
                recording,
                endpoint,
                stop,
                Playing(on_begin=begin),
                credentials=credentials,
            )
        )
        async with (
            ZenohFabric(
                "watcher",
                recording.swarm,
                HubAddress(hub.endpoint, read_credentials(keys, "watcher")),
                patience=PATIENCE,
            ) as watcher,
            ZenohFabric(
                "cell/0",
                recording.swarm,
                HubAddress(hub.endpoint, read_credentials(keys, "cell")),
                patience=PATIENCE,
            ) as herald,
        ):
            await watcher.subscribe(("**",), heard)
            await watcher.watch(seen)
            await herald.announce()
            await seen.wait(("cell/0", True))
            connected.set()
            played = await playing
            last = list(recording.messages())[-1].message
            await heard.wait(last)
    assert played.ticks == TICKS
    observed = [m for m in heard.messages if isinstance(m, wire.Observation)]
    assert [each.tick for each in observed] == list(range(1, TICKS + 1))


async def test_a_recording_is_not_played_to_the_network_in_the_clear(
    tmp_path: Path,
) -> None:
    with Writer(tmp_path / "log.mcap") as writer:
        writer.start({"swarm": SWARM})
        writer.finish({}, {})
    recording = Recording.open(tmp_path / "log.mcap")
    with pytest.raises(InvalidValueError, match=r"^endpoint: must be tcp/ on loopback"):
        await play_on(recording, "tcp/0.0.0.0:0", asyncio.Event())


def test_the_command_makes_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    command = [
        "init",
        "keys",
        str(folder),
        "--host",
        "hub.example",
        "--days",
        "2",
        "--format",
        "json",
    ]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    facts = msgspec.json.decode(done.stdout.splitlines()[-1])
    assert facts["folder"] == str(folder)
    assert facts["hosts"][-1] == "hub.example"
    until = datetime.fromisoformat(facts["until"])
    assert timedelta(days=1) < until - datetime.now(UTC) <= timedelta(days=2)
    assert read_credentials(folder, "hub").name == "hub"
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 2
    assert "keys: must not exist yet" in again.stderr
    wrong = CliRunner().invoke(
        app, ["init", "keys", str(tmp_path / "b"), "--days", "0"]
    )
    assert wrong.exit_code == 2
