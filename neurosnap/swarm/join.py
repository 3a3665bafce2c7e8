"""A share of a swarm's cells, on whatever machine reaches its hub."""

import asyncio
from collections.abc import Sequence

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.fabric.access import Role
from neurosnap.swarm.network import Network
from neurosnap.swarm.process import Reporter, Seat, be_cell
from neurosnap.swarm.supervisor import Supervisor, allow_files

_GRACE = 10.0  # seconds a part may take to end


async def join(
    network: Network, swarm: str, cells: Sequence[int], stop: asyncio.Event
) -> None:
    """Be some of a swarm's cells, a process each, until its coordinator has gone.

    They may come up before it does, or after; it waits for all it needs. No process
    outlives the call.

    Args:
        network: Where the hub is; `Network.connect` names it.
        swarm: The swarm's id.
        cells: Which of its cells.
        stop: Ends it before that; the swarm then misses these cells, and fails.

    Raises:
        InvalidValueError: The network or the cells cannot be.
        SwarmError: A cell failed, or would not end.
    """
    if not network.connect:
        rule = "must say where the hub of the swarm listens"
        raise InvalidValueError("connect", rule, network.connect)
    network.check()
    names = [f"cell/{cell}" for cell in cells]
    credentials = {
        role: network.credentials(role) for role in ("cell", "watcher") if network.tls
    }

    def seat(who: str, role: Role) -> Seat:
        return Seat(
            who,
            swarm,
            network.connect,
            credentials=credentials.get(role),
            insecure=network.insecure,
        )

    allow_files(len(names) + 1)
    async with Supervisor() as supervisor:
        watcher = await supervisor.start(be_watcher, seat("watcher", "watcher"))
        await supervisor.start_many(
            be_cell,
            [(seat(who, "cell"), (n,)) for who, n in zip(names, cells, strict=True)],
        )
        events = (supervisor.failed, stop, watcher.ended)
        waits = [asyncio.create_task(event.wait(), name="join") for event in events]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waits:
                task.cancel()
        late = await supervisor.end(names, _GRACE + 0.02 * len(names))
        late += await supervisor.end(["watcher"], _GRACE)
        if supervisor.error is not None:
            raise supervisor.error
    if late:
        rule = "every part must end when asked to"
        raise SwarmError(f"swarm: {rule}, killed: {', '.join(late)}")


async def be_watcher(seat: Seat, stop: asyncio.Event, reporter: Reporter) -> None:
    """Look on until the swarm's coordinator has come and gone."""
    gone = asyncio.Event()

    def change(who: str, alive: bool) -> None:
        if who == "coordinator" and not alive:
            gone.set()

    async with seat.fabric() as fabric:
        await fabric.watch(change)
        events = (gone, stop)
        waits = [asyncio.create_task(event.wait(), name="watcher") for event in events]
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waits:
                task.cancel()
    reporter.done()
