"""Who has a certificate does what its role may, and nothing else."""

import asyncio
from pathlib import Path

import pytest
import zenoh

from neurosnap import wire
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.make_keys import make_keys
from neurosnap.fabric.zenoh.session import configuration
from tests.support.fabrics import Seen
from tests.support.secured_hub import SWARM, hub_with
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("security") / "keys"
    make_keys(folder)
    return folder


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


async def test_a_cell_cannot_rewire_or_conduct_others(keys: Path) -> None:
    everything, neighbour, world = Heard(), Heard(), Heard()
    seen = Seen()
    with hub_with(keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("cell/1") as cell,
            hub.end("world") as place,
            hub.end("cell/0") as intruder,
        ):
            await ears.subscribe(("**",), everything)
            await cell.subscribe(wire.cell_keys(1), neighbour)
            await place.subscribe(("state", "decision"), world)
            await ears.watch(seen)
            for end in (cell, place, intruder):
                await end.announce()
                await seen.wait((end.who, True))
            # In order on one session: once its pulse is there, the rest would be too.
            intruder.publish(*FORBIDDEN, PULSE)
            assert await everything.wait(PULSE) == [PULSE]
            # What was dropped shows as a gap, audited or not.
            assert everything.sequences == [len(FORBIDDEN)]
            assert await neighbour.wait(PULSE) == [PULSE]
            assert world.messages == []
            # The same wiring from whom it may come.
            async with hub.end("coordinator") as coordinator:
                coordinator.publish(WIRING)
                await neighbour.wait(WIRING)
    tried = {line for line in hub.refused if line.startswith("cell refused: Put on ")}
    assert tried == {
        f"cell refused: Put on neurosnap/{SWARM}/{message.key}" for message in FORBIDDEN
    }
    assert len(hub.refused) == len(FORBIDDEN)  # each was told once, and nothing else


async def test_a_cell_can_neither_listen_to_others_nor_pass_for_them(
    keys: Path,
) -> None:
    overheard, everything, seen, spied = Heard(), Heard(), Seen(), Seen()
    with hub_with(keys) as hub:
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


@pytest.mark.parametrize("mode", ["peer", "router"])
async def test_a_cell_gains_nothing_as_a_peer_or_a_router(
    keys: Path, mode: str
) -> None:
    everything, seen = Heard(), Seen()
    intruder = Credentials.in_folder(keys, "cell")
    with hub_with(keys) as hub:
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


async def test_a_watcher_sees_all_and_says_nothing(keys: Path) -> None:
    heard, others = Heard(), Heard()
    last = wire.Leave("cell/0")
    with hub_with(keys) as hub:
        async with (
            hub.end("watcher") as watcher,
            hub.end("watcher") as sly,
            hub.end("recorder") as recorder,
            hub.end("cell/0") as cell,
        ):
            seen, also_seen = Seen(), Seen()
            await watcher.subscribe(("**",), heard)
            await recorder.subscribe(("**",), others)
            await watcher.watch(seen)
            await recorder.watch(also_seen)  # asked for behind its subscription
            await cell.announce()
            await seen.wait(("cell/0", True))
            await also_seen.wait(("cell/0", True))
            sly.publish(wire.Leave("cell/0"), wire.Fault("watcher", ""))
            cell.publish(PULSE, last)
            assert await heard.wait(last) == [PULSE, last]
            assert await others.wait(last) == [PULSE, last]
    assert set(hub.refused) == {
        f"watcher refused: Put on neurosnap/{SWARM}/leave/cell/0",
        f"watcher refused: Put on neurosnap/{SWARM}/fault/watcher",
    }
