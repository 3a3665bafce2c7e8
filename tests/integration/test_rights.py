"""Who has a certificate does what its role may, speaks for itself, and nothing else.

An intruder is let in, hears what its certificate may hear, and knows the protocol. It
tries alone, or strikes while a run is under way.
"""

import asyncio
import shutil
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
from neurosnap.fabric.security.make_keys import make_keys, revoke
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.fabric.zenoh.session import configuration
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.exhaustive import rows
from tests.support.fabrics import Seen
from tests.support.secured_hub import SWARM, Hub, hub_with
from tests.support.secured_swarm import options, run_swarm
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


WIRING = wire.Wiring(cell=1, epoch=1, after=0, add=(4,))
FORBIDDEN: tuple[wire.Message, ...] = (
    WIRING,
    wire.Decision(1, 0, "mine"),
    wire.WaveStart(1, 1, "state", 0, 1),
    wire.Observation(1, b"\x01"),
    wire.State(1, 1, b"", False, 0, 0, 0, 0, 0),
    wire.KeyFrame(1, b""),
)
PULSE = wire.Pulse(wave=1, source=0, target=2, hops=1, credit=1)


async def test_a_cell_cannot_conduct_others_and_a_watcher_says_nothing(
    role_keys: Path,
) -> None:
    everything, watched, neighbour, world = Heard(), Heard(), Heard(), Heard()
    seen = Seen()
    with hub_with(role_keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("watcher") as watcher,
            hub.end("watcher") as sly,
            hub.end("cell/1") as cell,
            hub.end("world") as place,
            hub.end("cell/0") as intruder,
        ):
            await ears.subscribe(("**",), everything)
            await watcher.subscribe(("**",), watched)
            await watcher.confirm()
            await cell.subscribe(wire.cell_keys(1), neighbour)
            await place.subscribe(("state", "decision"), world)
            await ears.watch(seen)
            for end in (cell, place, intruder):
                await end.announce()
                await seen.wait((end.who, True))
            sly.publish(wire.Leave("cell/0"), wire.Fault("watcher", ""))
            # In order on one session: once its pulse is there, the rest would be too.
            intruder.publish(*FORBIDDEN, PULSE)
            assert await everything.wait(PULSE) == [PULSE]
            # What was dropped shows as a gap, audited or not.
            assert everything.sequences == [len(FORBIDDEN)]
            assert await watched.wait(PULSE) == [PULSE]
            assert await neighbour.wait(PULSE) == [PULSE]
            assert world.messages == []
            # The same wiring from whom it may come.
            async with hub.end("coordinator") as coordinator:
                coordinator.publish(WIRING)
                await neighbour.wait(WIRING)
    prefix = f"refused: Put on neurosnap/{SWARM}"
    assert sorted(hub.refused) == sorted(
        [
            *(f"cell {prefix}/{message.key}" for message in FORBIDDEN),
            *(f"watcher {prefix}/{key}" for key in ("leave/cell/0", "fault/watcher")),
        ]
    )


async def test_a_cell_can_neither_listen_to_others_nor_pass_for_them(
    role_keys: Path,
) -> None:
    overheard, everything, seen, spied = Heard(), Heard(), Seen(), Seen()
    with hub_with(role_keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("world") as world,
            hub.end("coordinator", "cell") as intruder,
            # What a session says it hears itself: to spy takes another one.
            hub.end("cell/0") as spy,
        ):
            await ears.subscribe(("**",), everything)
            await ears.watch(seen)
            await spy.subscribe(("**",), overheard)
            await spy.subscribe(("cellreport/**", "decision"), overheard)
            await spy.watch(spied)
            await intruder.announce()
            await world.announce()
            await seen.wait(("world", True))
            world.publish(wire.Leave("world"))
            await everything.wait(wire.Leave("world"))
    assert seen.changes.count(("coordinator", True)) == 0
    assert overheard.messages == []
    assert spied.changes == []
    prefix = f"neurosnap/{SWARM}"
    assert set(hub.refused) >= {
        f"cell refused: Declare Subscriber on {prefix}/**",
        f"cell refused: Declare Subscriber on {prefix}/cellreport/**",
        f"cell refused: Declare Subscriber on {prefix}/decision",
        f"cell refused: Liveliness Token on {prefix}/alive/coordinator",
        f"cell refused: Declare Liveliness Subscriber on {prefix}/alive/**",
    }


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


async def test_nobody_uses_up_the_numbers_or_says_the_last_word_of_another(
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
    assert set(hub.refused) >= {
        f"cell refused: Put on neurosnap/{SWARM}/{key}"
        for key in (
            "fault/coordinator",
            "leave/**",
            *(f"leave/{who}" for who in others),
        )
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


# The command --------------------------------------------------------------------------


def test_the_command_makes_keys_a_part_and_revokes_one(tmp_path: Path) -> None:
    folder = tmp_path / "keys"

    def call(*more: str) -> Result:
        line = ["init", "keys", str(folder), *more, "--format", "json"]
        return CliRunner().invoke(app, line)

    parts = ("--parts", "cell/0-2,7", "--parts", "worker/0")
    made = call(*parts, "--host", "hub.example", "--days", "2")
    assert made.exit_code == 0, made.output
    facts = msgspec.json.decode(made.stdout.splitlines()[-1])
    assert (facts["folder"], facts["hosts"][-1]) == (str(folder), "hub.example")
    until = datetime.fromisoformat(facts["until"])
    assert timedelta(days=1) < until - datetime.now(UTC) <= timedelta(days=2)
    assert facts["parts"] == ["cell/0", "cell/1", "cell/2", "cell/7", "worker/0"]
    assert "cell" not in facts["roles"]
    assert read_credentials(folder, "cell/7").name == "cell/7"
    again = call()
    assert (again.exit_code, "keys: must not exist yet" in again.stderr) == (2, True)
    revoked = call("--revoke", "cell/7")
    assert revoked.exit_code == 0, revoked.output
    assert "once the hub has been started again" in revoked.stderr
    assert "cell/7#1" in read_credentials(folder, "hub").accepted
    assert call("--revoke", "cell/8").exit_code == 2
    assert call("--revoke", "cell/7", "--parts", "cell/9").exit_code == 2
