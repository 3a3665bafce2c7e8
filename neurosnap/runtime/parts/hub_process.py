"""The hub process: the router that every part connects to."""

import asyncio
import shutil

from neurosnap.fabric.zenoh.denied_log import telling_refusals
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.runtime.parts.child_process import Reporter, Seat


async def be_hub(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    sessions: int,
    folder: str,
    audit: bool,
) -> None:
    """Be the router all others connect to.

    `folder` is the swarm's own and goes with the hub: a launcher that was killed cannot
    remove it.
    """
    with telling_refusals(audit=audit):
        session = await asyncio.to_thread(
            open_hub,
            [seat.endpoint],
            sessions,
            credentials=seat.credentials,
            insecure=seat.insecure,
        )
        try:
            reporter.ready()
            await stop.wait()
        finally:
            await asyncio.to_thread(session.close)
            shutil.rmtree(folder, ignore_errors=True)
