"""Swarms put together part by part, with somebody in between."""

import asyncio
from collections.abc import Collection, Sequence
from pathlib import Path

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import SwarmError
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.fabric.protocol import Handler
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.hub_and_cell import run_cell
from neurosnap.runtime.parts.job import take_part
from neurosnap.runtime.parts.world_process import run_world
from neurosnap.sensorium import complete, unpack
from neurosnap.sources.open import open_source
from tests.support.played_runs import SEED, SENSORS, TICKS, options_for, write_readings

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]


@pytest.fixture
def readings(tmp_path: Path) -> str:
    return write_readings(tmp_path / "readings.csv", TICKS)


class Meddled(MemoryFabric):
    """A part's end of the network with somebody in between, who changes messages."""

    def outgoing(self, message: wire.Message) -> wire.Message | None:
        """Return what is sent in its place; None if it is withheld."""
        return message

    def incoming(self, message: wire.Message) -> wire.Message:
        """Return what arrives in its place."""
        return message

    def publish(self, *messages: wire.Message) -> None:
        for message in messages:
            passed = self.outgoing(message)
            if passed is not None:
                super().publish(passed)

    async def subscribe(
        self, keys: Sequence[str], handler: Handler, *, poll: float | None = None
    ) -> None:
        def handle(deliveries: list[wire.Delivery]) -> None:
            for delivery in deliveries:
                message = self.incoming(wire.decode(delivery.key, delivery.payload))
                handler([delivery._replace(payload=wire.encode(message))])

        await super().subscribe(keys, handle, poll=poll)


async def by_hand(
    options: RunOptions,
    heard: list[wire.Message],
    meddled: type[Meddled] = Meddled,
    absent: Collection[str] = (),
    patience: float = 10.0,
) -> None:
    """Run a swarm part by part; `heard` gets what the coordinator said."""
    hub, leave = MemoryHub(), asyncio.Event()
    source = open_source(options.source, options.seed)
    cells = options.host_names()

    def listen(deliveries: list[wire.Delivery]) -> None:
        heard.extend(wire.decode(d.key, d.payload) for d in deliveries)

    async def be_cell(number: int) -> None:
        async with meddled(hub, cells[number]) as fabric:
            await take_part(fabric, run_cell(number, fabric, leave))

    async def be_world() -> None:
        async with hub.fabric("world") as fabric:
            await take_part(
                fabric, run_world(source, Body(own=source.sensors), fabric, leave)
            )

    hub.fabric("listener").listen(("state", "reached"), listen)
    try:
        async with asyncio.TaskGroup() as group:
            for number, who in enumerate(cells):
                if who not in absent:
                    group.create_task(be_cell(number), name=who)
            group.create_task(be_world(), name="world")
            async with hub.fabric("coordinator") as fabric:
                await run_coordinator(
                    Coordinator(options),
                    fabric,
                    asyncio.Event(),
                    parts=["world", *cells],
                    deadlines=Deadlines(options.deadline, parts=patience),
                )
            leave.set()
    except BaseExceptionGroup as errors:
        (error,) = errors.exceptions
        raise error from None
    finally:
        source.close()


def states_in(heard: Sequence[wire.Message]) -> list[list[bool]]:
    return [
        unpack(message.literals, 2 * SENSORS).tolist()
        for message in heard
        if isinstance(message, wire.State)
    ]


async def test_with_one_report_too_few_the_run_goes_on_after_a_repeat(
    readings: str,
) -> None:
    lost: list[wire.CellReport] = []

    class OneLost(Meddled):
        def outgoing(self, message: wire.Message) -> wire.Message | None:
            if isinstance(message, wire.CellReport) and message.wave == 9 and not lost:
                lost.append(message)
                return None
            return message

    options = options_for(readings, deadline=0.2)
    undisturbed: list[wire.Message] = []
    heard: list[wire.Message] = []
    await by_hand(options, undisturbed)
    await by_hand(options, heard, OneLost)
    assert len(lost) == 1
    assert states_in(heard) == states_in(undisturbed)
    assert len(states_in(heard)) == TICKS


def reach(edges: NDArray[np.bool_], start: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return all that paths from `start` lead to."""
    found = start.copy()
    while True:
        more = found | edges[found].any(axis=0)
        if (more == found).all():
            return found
        found = more


async def test_the_wiring_a_cell_has_is_what_the_state_comes_of(readings: str) -> None:
    # Two cells are told what nobody has learned: that s6 implies not s7, and, which is
    # the same, that s7 implies not s6. A cell that alone is told so waits for a pulse
    # that never comes, and each wave for its deadline.
    extra = {6: 15, 7: 13}

    class Misled(Meddled):
        def incoming(self, message: wire.Message) -> wire.Message:
            if not isinstance(message, wire.Wiring) or message.cell not in extra:
                return message
            target = extra[message.cell]
            return msgspec.structs.replace(
                message,
                add=tuple(sorted({*message.add, target})),
                drop=tuple(b for b in message.drop if b != target),
            )

    options = options_for(readings)
    heard: list[wire.Message] = []
    await by_hand(options, heard, Misled)

    snapshot, honest = options.new_snapshot(), []
    expected, graphs = [], []
    opened = open_source(readings, SEED)
    seen = opened.first()
    while seen is not None:
        bits = seen.bits
        honest.append(snapshot.observe(bits).tolist())
        edges = snapshot.poc_graph().hasse().copy()
        for cell, target in extra.items():
            edges[2 * cell, target] = True
        graphs.append(edges)
        above = reach(edges, complete(bits))
        expected.append((above & ~above.reshape(-1, 2)[:, ::-1].reshape(-1)).tolist())
        seen = opened.step(-1)
    opened.close()
    assert states_in(heard) == expected
    differ = sum(one != other for one, other in zip(expected, honest, strict=True))
    assert differ > TICKS / 8
    for message in heard:
        if isinstance(message, wire.Reached):
            start = np.zeros(2 * SENSORS, np.bool_)
            start[list(message.signal)] = True
            above = reach(graphs[message.tick - 1], start)
            assert unpack(message.literals, 2 * SENSORS).tolist() == above.tolist()


async def test_a_cell_that_never_comes_up_is_named(readings: str) -> None:
    expected = (
        r"^swarm: every part must come up within 0\.05 s, missing: cell/2, cell/6$"
    )
    with pytest.raises(SwarmError, match=expected):
        await by_hand(
            options_for(readings), [], absent=["cell/6", "cell/2"], patience=0.05
        )
