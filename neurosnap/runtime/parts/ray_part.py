"""A part as an actor of a Ray cluster: what runs in the process that Ray starts.

It imports nothing of Ray, which makes an actor of it.
"""

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress

from neurosnap.runtime.parts.job import Job, PartConnection, PartContext, carry_out
from neurosnap.runtime.parts.reports import Reporter


class RayPart:
    """One part.

    Args:
        who: Its name.
        folder: Where whoever started it works.
        path: Where whoever started it looks for modules: a world may be of one that the
            nodes of the cluster were started without.
        shared: It is on the same machine, so files are looked for in that folder. On
            another machine they are, too, if that has such a folder.
    """

    def __init__(
        self, who: str, folder: str, path: Sequence[str], *, shared: bool
    ) -> None:
        self._who = who
        self._stop = asyncio.Event()
        sys.path += [place for place in path if place not in sys.path]
        if shared:
            os.chdir(folder)
        else:
            with suppress(OSError):
                os.chdir(folder)

    def __repr__(self) -> str:
        """Return its name, which Ray writes before what it logs."""
        return self._who

    async def live(self, job: Job, connection: PartConnection) -> AsyncIterator[bytes]:
        """Run a job, and yield its reports as they come, until it has ended."""
        line = _Line()
        context = PartContext(connection, self._stop, Reporter(self._who, line))
        working = asyncio.create_task(carry_out(job, context), name=self._who)
        working.add_done_callback(line.close)
        while (report := await line.said.get()) is not None:
            yield report
        await working

    async def end(self) -> None:
        """Ask the job to end in order."""
        self._stop.set()


class _Line:
    """A queue that any thread writes to and the event loop reads."""

    def __init__(self) -> None:
        self.said: asyncio.Queue[bytes | None] = asyncio.Queue()
        self._loop = asyncio.get_running_loop()

    def send_bytes(self, buf: bytes, /) -> None:
        self._loop.call_soon_threadsafe(self.said.put_nowait, buf)

    def close(self, _: object) -> None:
        self.said.put_nowait(None)
