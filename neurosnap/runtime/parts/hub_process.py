"""The hub process: the router that every part connects to."""

import asyncio
import shutil

import msgspec

from neurosnap.fabric.zenoh.denied_log import telling_refusals
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.runtime.parts.job import PartContext


class HubJob(msgspec.Struct, frozen=True):
    """The router that all others connect to."""

    sessions: int
    """How many may connect."""
    folder: str
    """The swarm's own, which goes with the hub: a launcher that was killed cannot
    remove it."""
    audit: bool
    """Log what is refused."""

    async def run(self, part: PartContext) -> None:
        """Route until the end."""
        connection = part.connection
        with telling_refusals(audit=self.audit):
            session = await asyncio.to_thread(
                open_hub,
                [connection.endpoint],
                self.sessions,
                credentials=connection.credentials,
                insecure=connection.insecure,
            )
            try:
                part.reporter.ready()
                await part.stop.wait()
            finally:
                await asyncio.to_thread(session.close)
                shutil.rmtree(self.folder, ignore_errors=True)
