"""A certificate grants exactly the permissions of its role.

An intruder is let in, hears what its certificate may hear, and knows the protocol. It
tries alone, or strikes while a run is under way.
"""

import asyncio
import secrets
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.fabric.certificates import make_keys, read_credentials
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.recording.format.completeness import Completeness
from tests.support.command_line import happy, refused
from tests.support.exhaustive import rows
from tests.support.fabrics import Heard, Seen, are_one_network
from tests.support.ports import free_port
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.secured_hub import SWARM, Hub, hub_with, run_swarm
from tests.support.services import going

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


@pytest.fixture(params=["one hub", "the ends of a line of three"])
def hubs(request: pytest.FixtureRequest, role_keys: Path) -> Iterator[tuple[Hub, Hub]]:
    """The hub of the parts that are attacked, and that of the intruder."""
    with hub_with(role_keys) as here:
        if request.param == "one hub":
            yield here, here
            return
        with (
            hub_with(role_keys, here) as between,
            hub_with(role_keys, between) as there,
        ):
            asyncio.run(are_one_network(here.end, there.end))
            yield here, there


async def test_a_cell_cannot_conduct_others_and_a_watcher_says_nothing(
    hubs: tuple[Hub, Hub],
) -> None:
    here, there = hubs
    everything, neighbour, world, seen = Heard(), Heard(), Heard(), Seen()
    async with (
        here.end("recorder") as ears,
        here.end("cell/1") as cell,
        here.end("world") as place,
        there.end("watcher") as usher,
        there.end("cell/0") as intruder,
    ):
        await usher.watch(seen)
        await ears.subscribe(("**",), everything)
        await cell.subscribe(wire.cell_keys(1), neighbour)
        await place.subscribe(("state", "decision"), world)
        for end in (ears, cell, place):
            await end.announce()
            await seen.wait((end.who, True))
        # A watcher says nothing.
        usher.publish(wire.Leave("cell/0"), wire.Fault("watcher", ""))
        # In order on one session: once its pulse is there, the rest would be too.
        intruder.publish(*FORBIDDEN, PULSE)
        assert await everything.wait_for(PULSE) == [PULSE]
        # What was dropped shows as a gap.
        assert everything.sequences() == [len(FORBIDDEN)]
        assert await neighbour.wait_for(PULSE) == [PULSE]
        # The same wiring, from there, by whom it may come.
        async with there.end("coordinator") as coordinator:
            coordinator.publish(WIRING)
            await neighbour.wait_for(WIRING)
        assert world.messages() == []


async def test_a_cell_can_neither_listen_to_others_nor_pass_for_them(
    hubs: tuple[Hub, Hub],
) -> None:
    here, there = hubs
    everything, overheard, allowed = Heard(), Heard(), Heard()
    seen, spied = Seen(), Seen()
    observation, last = wire.Observation(1, b"\1"), wire.Leave("world")
    async with (
        here.end("recorder") as ears,
        here.end("cell/0") as spy,
        here.end("coordinator", "cell") as pretender,
        here.end("cell/1") as cell,
        there.end("watcher") as usher,
        there.end("world") as world,
    ):
        await usher.watch(seen)
        await ears.subscribe(("**",), everything)
        await cell.subscribe(wire.cell_keys(1), allowed)
        await spy.subscribe(("**",), overheard)
        await spy.subscribe(("leave/**", "cellreport/**", "decision"), overheard)
        await spy.watch(spied)
        await pretender.announce()
        for end in (cell, ears):
            await end.confirm()
        spy.publish(PULSE)
        await everything.wait_for(PULSE)  # behind all that it asked for
        await allowed.wait_for(PULSE)  # another's message may overtake it
        for end in (cell, ears):
            await end.announce()
            await seen.wait((end.who, True))
        world.publish(observation, last)
        assert await everything.wait_for(last) == [PULSE, observation, last]
        assert await allowed.wait_for(observation) == [PULSE, observation]
        assert set(overheard.messages()) <= {PULSE}  # its own
        assert spied.changes == []
        assert ("coordinator", True) not in seen.changes


@pytest.mark.parametrize("mode", rows(["router"], ["peer"]))
async def test_a_cell_gains_nothing_as_a_peer_or_a_router(
    role_keys: Path, mode: str
) -> None:
    everything, seen = Heard(), Seen()
    with hub_with(role_keys) as hub:
        async with hub.end("recorder") as ears, hub.end("cell/0") as cell:
            await ears.subscribe(("**",), everything)
            await ears.watch(seen)
            session = await asyncio.to_thread(hub.session, mode)
            token = session.liveliness().declare_token(
                f"neurosnap/{SWARM}/alive/coordinator/0"
            )
            session.put(f"neurosnap/{SWARM}/{WIRING.key}", wire.encode(WIRING))
            await asyncio.to_thread(token.undeclare)
            await asyncio.to_thread(session.close)
            await cell.announce()
            await seen.wait(("cell/0", True))
            cell.publish(PULSE)
            assert await everything.wait_for(PULSE) == [PULSE]
    assert ("coordinator", True) not in seen.changes


def test_a_router_that_is_no_hub_is_named(role_keys: Path) -> None:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with going("serve", "hub", "--listen", endpoint, "--tls", role_keys) as hub:
        assert "listening on" in hub.stderr.readline()
        with Hub(endpoint, role_keys, hub.pid).session("router"):
            said = hub.stderr.readline()
    assert said.startswith(
        "cell is linked and no hub: what hubs send each other may be"
    )


def test_hubs_of_different_keys_are_not_linked(role_keys: Path, tmp_path: Path) -> None:
    make_keys(tmp_path / "others")
    with hub_with(role_keys) as hub, hub_with(tmp_path / "others", hub) as stranger:

        async def pass_by() -> None:
            heard, seen, mark = Heard(), Seen(), secrets.token_hex(2)
            async with hub.end("recorder") as ears, hub.end("cell/1") as cell:
                await ears.subscribe(("**",), heard)
                await ears.watch(seen)
                async with stranger.end("world") as world:
                    await world.announce()
                    world.publish(wire.Leave("world"))
                    await world.confirm()
                await cell.announce()
                await seen.wait(("cell/1", True))
                fault = wire.Fault("cell/1", mark)
                cell.publish(fault)
                assert await heard.wait_for(fault) == [fault]
                assert seen.changes == [("cell/1", True)]

        asyncio.run(pass_by())
    assert any("zenoh_link" in line for line in hub.refused)


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
) -> Completeness:
    """Run a swarm; send `attack` with the certificate of `who` in the middle of it."""
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
        balance = await run_swarm(hub, log, TICKS, keyframe_every=20)
        assert sent.is_set()
    return balance


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
        balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert balance.duplicates == 0
    assert hub.refused == []
    # Under keys of its own it came through, and was nobody's.
    assert balance.foreign >= FORGED
    # The recording is of the whole run, and is what the run would have said.
    assert [s.tick for s in of_type(log, wire.State)] == list(range(1, TICKS + 1))
    assert_true_run(log)


# The command --------------------------------------------------------------------------


def test_the_command_makes_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    facts = happy("init", "keys", folder, "--host", "hub.example", "--days", 2)
    assert (facts["folder"], facts["hosts"][-1]) == (str(folder), "hub.example")
    until = datetime.fromisoformat(facts["until"])
    assert timedelta(days=1) < until - datetime.now(UTC) <= timedelta(days=2)
    assert read_credentials(folder, "cell/7").role == "cell"
    assert "keys: must not exist yet" in refused("init", "keys", folder)
