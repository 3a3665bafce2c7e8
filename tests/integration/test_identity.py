"""Who speaks is who it says: what a stolen certificate tries against a run under TLS.

The intruder is let in, hears what its certificate may hear, and knows the protocol. It
strikes while the run is under way.
"""

import asyncio
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner, Result

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys, revoke
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.fabrics import Seen
from tests.support.secured_hub import SWARM, Hub, hub_with
from tests.support.secured_swarm import options, run_swarm
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

TICKS = 60
STRIKE = 5  # the tick at which it strikes
FORGED = 100  # messages of each kind


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identity") / "keys"
    make_keys(folder)
    return folder


def forged(
    message: wire.Message, key: str, count: int = FORGED
) -> Iterator[wire.Delivery]:
    """Yield a message under some key, with numbers that its sender is yet to use."""
    for number in range(count):
        yield wire.Delivery(key, 50 + number, 0, wire.encode(message))


async def struck(
    hub: Hub, attack: list[wire.Delivery], log: Path, who: str = "cell/9"
) -> tuple[RunOptions, Completeness]:
    """Run a swarm; send `attack` with the certificate of `who` in the middle of it."""
    given = msgspec.structs.replace(options(), ticks=TICKS, keyframe_every=20)
    sent = asyncio.Event()

    async with hub.end(who) as intruder:

        def strike(burst: list[wire.Delivery]) -> None:
            for delivery in burst:
                message = wire.decode(delivery.key, delivery.payload)
                assert isinstance(message, wire.Observation)
                if message.tick == STRIKE:
                    for each in attack:
                        ZenohFabric.forward(intruder, each)
                    sent.set()

        await intruder.subscribe(("observation",), strike)
        balance = await run_swarm(hub, given, log)
        assert sent.is_set()
    return given, balance


def check_untouched(log: Path) -> None:
    """The recording is of the whole run, and is what the run would have said."""
    ticks = [
        each.message.tick
        for each in Recording.open(log).messages(("state",))
        if isinstance(each.message, wire.State)
    ]
    assert ticks == list(range(1, TICKS + 1))
    verdict = verify(log)
    assert (verdict.difference, verdict.complete) == (None, True)


async def test_nobody_can_use_up_the_numbers_of_another(
    keys: Path, tmp_path: Path
) -> None:
    """The coordinator's own messages would be dropped as having come before."""
    fault = wire.Fault("coordinator", "mine")
    attack = [*forged(fault, "fault/coordinator"), *forged(fault, "fault/cell/9")]
    log = tmp_path / "log.mcap"
    with hub_with(keys) as hub:
        _, balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert balance.duplicates == 0
    # Under a key of its own it came through, and was nobody's.
    assert balance.foreign == FORGED
    assert f"cell refused: Put on neurosnap/{SWARM}/fault/coordinator" in hub.refused
    check_untouched(log)


async def test_nobody_can_say_the_last_word_of_another(
    keys: Path, tmp_path: Path
) -> None:
    """The run would end there, and be called whole."""
    log = tmp_path / "log.mcap"
    others = ("coordinator", "world", "recorder")
    attack = [
        delivery
        for who in others
        for key in (f"leave/{who}", "leave/cell/9", "leave/cell/*", "leave/**")
        for delivery in forged(wire.Leave(who), key, 1)
    ]
    with hub_with(keys) as hub:
        _, balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert set(hub.refused) >= {
        f"cell refused: Put on neurosnap/{SWARM}/leave/{who}" for who in (*others, "**")
    }
    check_untouched(log)


# A certificate a part -----------------------------------------------------------------


@pytest.fixture(scope="module")
def parted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parted") / "keys"
    sensors = len(options().sensors)
    make_keys(folder, parts=[f"cell/{number}" for number in range(sensors + 1)])
    return folder


async def test_a_part_speaks_for_itself_alone(parted: Path, tmp_path: Path) -> None:
    """Neither the last word, nor a fault, nor a pulse, nor a report of another cell."""
    log = tmp_path / "log.mcap"
    sensors = len(options().sensors)
    thief = f"cell/{sensors}"  # none of the run's, and so never in its way
    as_another: list[wire.Message] = [
        wire.Leave("cell/0"),
        wire.Leave("world"),
        wire.Fault("cell/0", "mine"),
        wire.CellReport(1, 0, 0, (0,), (0,), (0,), 0),
        *(wire.Pulse(n, 0, 2, 1, 1) for n in range(1, 300)),
    ]
    attack = [delivery for m in as_another for delivery in forged(m, m.key, 3)]
    own = [each for m in as_another for each in forged(m, f"fault/{thief}", 1)]
    with hub_with(parted) as hub:
        _, balance = await struck(hub, [*attack, *own], log, thief)
    assert balance.whole, balance
    assert (balance.duplicates, balance.foreign) == (0, len(own))
    tried = {f"{thief} refused: Put on neurosnap/{SWARM}/{m.key}" for m in as_another}
    assert tried <= set(hub.refused)
    check_untouched(log)


async def test_who_was_revoked_is_heard_no_more(parted: Path, tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    shutil.copytree(parted, folder)
    stolen = tmp_path / "stolen"
    shutil.copytree(parted, stolen)
    (stolen / "names.json").unlink()
    revoke(folder, "cell/1")
    heard, last = Heard(), wire.Leave("cell/0")
    mine = wire.Leave("cell/1")
    with hub_with(folder) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end_with("cell/1", read_credentials(stolen, "cell/1")) as thief,
            hub.end("cell/0") as cell,
        ):
            seen = Seen()
            await ears.subscribe(("**",), heard)
            await ears.watch(seen)
            thief.publish(mine)
            await thief.announce()
            async with hub.end("cell/1") as honest:
                await honest.announce()
                await seen.wait(("cell/1", True))
                honest.publish(mine, mine)
            await cell.announce()
            await seen.wait(("cell/0", True))
            cell.publish(last)
            assert await heard.wait(last) == [mine, mine, last]
    assert seen.changes.count(("cell/1", True)) == 1
    shown = f"refused: Liveliness Token on neurosnap/{SWARM}/alive/cell/1"
    assert any(line.endswith(shown) for line in hub.refused)


def test_the_command_makes_keys_a_part_and_revokes_one(tmp_path: Path) -> None:
    folder = tmp_path / "keys"

    def call(*more: str) -> Result:
        return CliRunner().invoke(
            app,
            ["init", "keys", str(folder), *more, "--format", "json"],
        )

    made = call("--parts", "cell/0-2,7", "--parts", "worker/0")
    assert made.exit_code == 0, made.output
    facts = msgspec.json.decode(made.stdout.splitlines()[-1])
    assert facts["parts"] == ["cell/0", "cell/1", "cell/2", "cell/7", "worker/0"]
    assert "cell" not in facts["roles"]
    assert read_credentials(folder, "cell/7").name == "cell/7"
    revoked = call("--revoke", "cell/7")
    assert revoked.exit_code == 0, revoked.output
    assert "once the hub has been started again" in revoked.stderr
    assert "cell/7#1" in read_credentials(folder, "hub").accepted
    assert call("--revoke", "cell/8").exit_code == 2
    assert call("--revoke", "cell/7", "--parts", "cell/9").exit_code == 2
