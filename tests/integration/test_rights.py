"""A certificate grants exactly the permissions of its role.

An intruder is let in, hears what its certificate may hear, and knows the protocol. It
tries alone, or strikes while a run is under way.
"""

import asyncio
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh
from typer.testing import CliRunner, Result

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.fabric.security.hub_address import Credentials
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.fabric.zenoh.session import configuration
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.exhaustive import rows
from tests.support.fabrics import Seen
from tests.support.intrusions import (
    PULSE,
    WIRING,
    conduct_others,
    spy_on_others,
)
from tests.support.secured_hub import SWARM, Hub, hub_with
from tests.support.secured_swarm import options, run_swarm
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


async def test_a_cell_cannot_conduct_others_and_a_watcher_says_nothing(
    role_keys: Path,
) -> None:
    with hub_with(role_keys) as hub:
        await conduct_others(hub, hub)


async def test_a_cell_can_neither_listen_to_others_nor_pass_for_them(
    role_keys: Path,
) -> None:
    with hub_with(role_keys) as hub:
        await spy_on_others(hub, hub)


@pytest.mark.parametrize("mode", rows(["router"], ["peer"]))
async def test_a_cell_gains_nothing_as_a_peer_or_a_router(
    role_keys: Path, mode: str
) -> None:
    everything, seen = Heard(), Seen()
    intruder = Credentials.in_folder(role_keys, "cell")
    with hub_with(role_keys) as hub:
        config = configuration(
            mode,
            connect__endpoints=[hub.endpoint],
            transport__link__tls=intruder.to_connect(),
        )
        async with hub.end("recorder") as ears, hub.end("cell/0") as cell:
            await ears.subscribe(("**",), everything)
            await ears.watch(seen)
            session = await asyncio.to_thread(zenoh.open, config)
            token = session.liveliness().declare_token(
                f"neurosnap/{SWARM}/alive/coordinator"
            )
            session.put(f"neurosnap/{SWARM}/{WIRING.key}", wire.encode(WIRING))
            await asyncio.to_thread(token.undeclare)
            await asyncio.to_thread(session.close)
            await cell.announce()
            await seen.wait(("cell/0", True))
            cell.publish(PULSE)
            assert await everything.wait(PULSE) == [PULSE]
    assert ("coordinator", True) not in seen.changes


# While a run is under way ------------------------------------------------------------

TICKS = 60
STRIKE = 5  # the tick at which it strikes
FORGED = 100  # messages of each kind


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


async def test_no_part_speaks_for_one_of_another_role(
    role_keys: Path, tmp_path: Path
) -> None:
    """Its own messages would be dropped as having come before, or the run end there."""
    fault, log = wire.Fault("coordinator", "mine"), tmp_path / "log.mcap"
    others = ("coordinator", "world", "recorder")
    attack = [*forged(fault, "fault/coordinator"), *forged(fault, "fault/cell/9")]
    attack += [
        delivery
        for who in others
        for key in (f"leave/{who}", "leave/cell/9", "leave/cell/*", "leave/**")
        for delivery in forged(wire.Leave(who), key, 1)
    ]
    with hub_with(role_keys) as hub:
        _, balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert balance.duplicates == 0
    # Under keys of its own it came through, and was nobody's.
    assert balance.foreign >= FORGED
    check_untouched(log)


# The command --------------------------------------------------------------------------


def test_the_command_makes_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"

    def call(*more: str) -> Result:
        line = ["init", "keys", str(folder), *more, "--format", "json"]
        return CliRunner().invoke(app, line)

    made = call("--host", "hub.example", "--days", "2")
    assert made.exit_code == 0, made.output
    facts = msgspec.json.decode(made.stdout.splitlines()[-1])
    assert (facts["folder"], facts["hosts"][-1]) == (str(folder), "hub.example")
    until = datetime.fromisoformat(facts["until"])
    assert timedelta(days=1) < until - datetime.now(UTC) <= timedelta(days=2)
    assert read_credentials(folder, "cell/7").role == "cell"
    again = call()
    assert (again.exit_code, "keys: must not exist yet" in again.stderr) == (2, True)
