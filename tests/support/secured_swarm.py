"""All parts of a swarm, each with its own certificate."""

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from neurosnap.agent.body import Body
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.runtime.parts import coordinator_process
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.hub_and_cell import run_cell
from neurosnap.runtime.parts.job import take_part
from neurosnap.runtime.parts.recorder_process import describe, run_recorder
from neurosnap.runtime.parts.world_process import run_world
from neurosnap.sources.open import open_source
from tests.support.secured_hub import SWARM, Hub

TICKS = 12


async def run_swarm(hub: Hub, options: RunOptions, log: Path) -> Completeness:
    """Run all parts over `hub`, each with its own session and certificate."""
    core = coordinator_process.coordinator_for(options, None)
    source = open_source(options.source, options.seed, options.arguments)
    cells = [f"cell/{number}" for number in range(len(options.sensors))]
    leave, over = asyncio.Event(), asyncio.Event()

    async def part(
        who: str, work: Callable[[ZenohFabric], Coroutine[Any, Any, object]]
    ) -> None:
        async with hub.end(who) as fabric:
            await take_part(fabric, work(fabric))

    async def record() -> Completeness:
        with SplitWriter(log, {**describe(options), "swarm": SWARM}) as writer:
            async with hub.end("recorder") as fabric:
                parts = ("coordinator", "world", *cells)
                return await run_recorder(writer, fabric, leave, parts=parts)

    async with asyncio.TaskGroup() as group:
        recording = group.create_task(record(), name="recorder")
        for number, who in enumerate(cells):
            group.create_task(
                part(who, lambda f, number=number: run_cell(number, f, leave)),  # type: ignore[misc]
                name=who,
            )
        group.create_task(
            part("world", lambda f: run_world(source, options.body, f, leave)),
            name="world",
        )
        await part(
            "coordinator",
            lambda f: run_coordinator(
                core,
                f,
                over,
                parts=("recorder", "world", *cells),
                deadlines=Deadlines(options.deadline),
            ),
        )
        leave.set()
    source.close()
    return await recording


def options() -> RunOptions:
    source = open_source("neurosnap/Path-v0", 2)
    source.close()
    return RunOptions(
        source="neurosnap/Path-v0",
        body=Body(own=source.sensors, actions=source.actions),
        ticks=TICKS,
        seed=2,
        threshold=0.1,
        keyframe_every=5,
    )
