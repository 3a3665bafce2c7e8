"""The intake process: takes in live readings, and outlives restarts.

When any part of a swarm dies, all are ended and started again. What comes from outside
meanwhile comes once, so a process of its own takes it in: it holds standard input or
the connection to a broker, writes each row to the journal and gives it to whichever
world asks. No swarm's restart touches it. When it dies itself, the world notices, and
both are started again; the journal says where they were.

A world says first which tick it goes on from: the rows after that are read from the
journal, and those that come follow them.
"""

import asyncio
import contextlib
import shutil
from pathlib import Path

import msgspec

from neurosnap.errors import NeurosnapError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.job import PartContext
from neurosnap.runtime.parts.world_process import lost_of, synced
from neurosnap.sensorium import pack
from neurosnap.sources.live import remote_source
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_readings import Bits
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.open import open_live

INTAKE = "intake"
"""What the part is called."""

_MOMENT = 0.05  # seconds until a thread that was let go is let go once more
_LAST = 5.0  # seconds a world may take to hear that it is over


class Taken(msgspec.Struct, frozen=True):
    """What came of taking readings in."""

    lost: int = 0
    """What was no reading, or had no tick although it should have."""


class IntakeJob(msgspec.Struct, frozen=True):
    """Takes in readings, keeps them and gives them to the world."""

    options: RunOptions
    folder: str
    """The journal."""
    address: str
    """The path of the socket to listen on, alone in its folder."""

    async def run(self, part: PartContext) -> None:
        """Take in readings until the end.

        Raises:
            NeurosnapError: The journal cannot be read or written.
        """
        options = self.options
        journal = Journal(Path(self.folder), options.body.own)
        source = open_live(
            options.source, options.arguments, journal=journal, most=options.ticks
        )
        counter = _Counter(source)
        socket = Path(self.address)
        try:
            await asyncio.to_thread(socket.unlink, missing_ok=True)
            server = await asyncio.start_unix_server(counter.serve, self.address)
            if source.resumed:
                counter.leave()
            async with synced(source, options.sync):
                part.reporter.ready()
                await part.stop.wait()
            server.close()
        finally:
            await asyncio.to_thread(source.close)
            await counter.wait_closed()
            # The folder is the run's own; a launcher that was killed cannot remove it.
            await asyncio.to_thread(shutil.rmtree, socket.parent, ignore_errors=True)
        part.reporter.done(Taken(lost_of(source, options)))


class _Counter:
    """Answers one world at a time."""

    def __init__(self, source: LiveSource) -> None:
        self._source = source
        self._turn = asyncio.Lock()
        self._keeping: asyncio.Task[None] | None = None
        self._serving: set[asyncio.Task[None]] = set()

    async def serve(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Answer a world until it is gone."""
        task = asyncio.current_task()
        if task is not None:
            self._serving.add(task)
            task.add_done_callback(self._serving.discard)
        try:
            async with self._turn:
                await self._arrive()
                try:
                    with contextlib.suppress(ConnectionError, EOFError):
                        await self._converse(reader, writer)
                finally:
                    self.leave()
        finally:
            writer.close()

    def leave(self) -> None:
        """Let changes be kept, since nobody is here to see them."""
        self._keeping = asyncio.create_task(
            asyncio.to_thread(self._source.keep_changes), name="intake/keep"
        )

    async def _arrive(self) -> None:
        """Let nothing be kept but what is asked for."""
        if self._keeping is not None:
            await self._let_go(self._keeping)
            self._keeping = None

    async def _let_go(self, waiting: asyncio.Task[object] | asyncio.Task[None]) -> None:
        """End what waits for the source; it may be on its way there still."""
        while not waiting.done():
            self._source.let_go()
            await asyncio.wait((waiting,), timeout=_MOMENT)
        await waiting

    async def _converse(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Answer question after question, until the world is gone."""
        asked = asyncio.create_task(_question(reader), name="intake/question")
        try:
            while True:
                question = await asked
                answer: asyncio.Task[remote_source.Reply] = asyncio.create_task(
                    asyncio.to_thread(self._answer, question), name="intake/answer"
                )
                # A world says nothing while it waits: what comes is its end.
                asked = asyncio.create_task(_question(reader), name="intake/question")
                await asyncio.wait((answer, asked), return_when=asyncio.FIRST_COMPLETED)
                if not answer.done():
                    await self._let_go(answer)
                    return
                writer.write(remote_source.encoded(answer.result()))
                await writer.drain()
        finally:
            asked.cancel()

    def _answer(self, question: remote_source.Question) -> remote_source.Reply:
        """Answer one question; on a thread of its own, which may wait long."""
        source = self._source
        try:
            if isinstance(question, remote_source.IntakeRecall):
                known = source.go_on(question.tick)
                return remote_source.IntakeAnswer(b"", _packed(known), False)
            action = question.action
            seen = source.step(action) if source.given else source.first()
        except NeurosnapError as error:
            return remote_source.IntakeFailed(str(error))
        if seen is None:
            return remote_source.Over()
        bits, told = pack(seen.bits), _packed(seen.known)
        return remote_source.IntakeAnswer(bits, told, seen.begins, seen.paused)

    async def wait_closed(self) -> None:
        """Wait until the world has heard that the source is closed, but not long."""
        for task in (*self._serving, self._keeping):
            if task is not None and not task.done():
                await asyncio.wait((task,), timeout=_LAST)


def _packed(known: Bits | None) -> bytes:
    return b"" if known is None else pack(known)


async def _question(reader: asyncio.StreamReader) -> remote_source.Question:
    """Return the next question.

    Raises:
        EOFError: None comes any more.
    """
    head = remote_source.HEAD
    (length,) = head.unpack(await reader.readexactly(head.size))
    return remote_source.questions.decode(await reader.readexactly(length))
