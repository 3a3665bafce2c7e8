"""The coordinator as the job of a process of its own, and what it brings home."""

import asyncio
from typing import Self

import msgspec

from neurosnap.record.past import Past
from neurosnap.record.resume import restore
from neurosnap.swarm.coordinator import Coordinator, Totals
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.part import take_part
from neurosnap.swarm.process import Reporter, Seat
from neurosnap.swarm.shell import conduct


class Result(msgspec.Struct):
    """What the coordinator brings home."""

    totals: Totals
    seconds: float
    """What the run took, once every part was up."""
    implications: list[tuple[str, str]]
    """The learned order by name, covering pairs only."""

    @classmethod
    def of(cls, core: Coordinator, seconds: float) -> Self:
        """Sum a core up."""
        named = core.graph.implications(core.snapshot.sensorium)
        return cls(core.totals, seconds, named)


def coordinator_for(options: RunOptions, past: Past | None) -> Coordinator:
    """Return the core of a run: new, or as it was where it is taken up again."""
    return Coordinator.of(options) if past is None else restore(past, options.ticks)


async def be_coordinator(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    options: RunOptions,
    past: Past | None,
    parts: tuple[str, ...],
) -> None:
    """Learn, conduct and decide."""
    core = coordinator_for(options, past)
    async with seat.fabric(swift=True) as fabric:
        seconds = await take_part(
            fabric,
            conduct(
                core,
                fabric,
                stop,
                parts=parts,
                deadline=options.deadline,
                patience=60.0 + 0.05 * len(parts),
                on_progress=reporter.progress,
            ),
        )
        reporter.done(Result.of(core, seconds))
