"""Forbidden actions tried by a cell with a valid certificate."""

from neurosnap import wire
from tests.support.fabrics import Seen
from tests.support.secured_hub import Hub
from tests.support.witnesses import Heard

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


async def conduct_others(here: Hub, there: Hub) -> None:
    """Fail to conduct, at one hub, the parts of the same or of a linked one."""
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
        assert await everything.wait(PULSE) == [PULSE]
        # What was dropped shows as a gap.
        assert everything.sequences == [len(FORBIDDEN)]
        assert await neighbour.wait(PULSE) == [PULSE]
        # The same wiring, from there, by whom it may come.
        async with there.end("coordinator") as coordinator:
            coordinator.publish(WIRING)
            await neighbour.wait(WIRING)
        assert world.messages == []


async def spy_on_others(here: Hub, there: Hub) -> None:
    """Fail to listen to what is for others, or to pass for them."""
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
        await everything.wait(PULSE)  # behind all that it asked for
        for end in (cell, ears):
            await end.announce()
            await seen.wait((end.who, True))
        world.publish(observation, last)
        assert await everything.wait(last) == [PULSE, observation, last]
        assert await allowed.wait(observation) == [PULSE, observation]
        assert set(overheard.messages) <= {PULSE}  # its own
        assert spied.changes == []
        assert ("coordinator", True) not in seen.changes
