"""The recorder process: writes all traffic of a swarm to a recording."""

import asyncio
from pathlib import Path

from neurosnap.protocol.resume_point import Past
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import Parts
from neurosnap.runtime.parts.child_process import Reporter, Seat
from neurosnap.sources.live.journal import journal_of


async def be_recorder(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    path: str,
    metadata: dict[str, str],
    past: Past | None,
    parts: tuple[str, ...],
) -> None:
    """Record everything, after what there is of a resumed run."""
    with Parts(path, metadata, past) as writer:
        async with seat.fabric() as fabric:
            balance = await run_recorder(
                writer, fabric, stop, parts=parts, journal=journal_of(Path(path))
            )
    reporter.done(balance)
