"""Runs a swarm with an intake process, which journals live readings until recorded.

The journal lies beside the recording. When the run ends in order, and all that came is
in the recording, it is deleted; otherwise it stays, and a run that is resumed from the
recording gets what is in it.

When any part of a swarm dies, all are ended and started again. Outside readings come
once, so another process takes them in, the intake: it holds standard input, the
connection to a broker, or the hub that programs put readings to, writes each row to the
journal and gives it to the world that asks. No swarm's restart touches it: a hub in the
intake is one that outlives the swarms. When it dies itself, the world notices, and both
are started again; the journal says where they were, and the next row since when nothing
was listened to. A world says first which tick it goes on from: the rows after that are
read from the journal, and those that come follow.
"""

import asyncio
import contextlib
import logging
import multiprocessing
import shutil
import tempfile
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError, NeurosnapError, PartDiedError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import first_path
from neurosnap.runtime.launch import SERVICES, new_swarm_id
from neurosnap.runtime.network import Connections
from neurosnap.runtime.parts.hub_and_cell import routing
from neurosnap.runtime.parts.job import PartConnection, PartContext
from neurosnap.runtime.parts.world_process import WayIn, synced
from neurosnap.runtime.registry import held
from neurosnap.runtime.request import Outcome, RunRequest
from neurosnap.runtime.supervisor import Supervisor
from neurosnap.sources.live import remote_source
from neurosnap.sources.live.journal import (
    Journal,
    JournalRow,
    journal_of,
    pack_known,
    read_journal,
    remove,
)
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.statistics import Statistics
from neurosnap.sources.open import ZENOH, is_live, lost_by, open_live

INTAKE = "intake"
"""What the part is called."""
_MOMENT = 0.05  # seconds until a thread that was let go is let go once more
_LAST = 5.0  # seconds a world may take to hear that it is over
_GRACE = 10.0  # seconds the intake may take to end
_AGAIN = 0.1  # seconds before it is started again
_logger = logging.getLogger(__name__)
Work = Callable[[RunRequest], Awaitable[Outcome]]
"""Runs the swarm; the request says how outside readings get to its world."""


class IntakeJob(msgspec.Struct, frozen=True):
    """The job of the intake: journals readings, and gives them to the world."""

    options: RunOptions
    folder: str
    """The journal."""
    address: str
    """The path of the socket to listen on, in a folder of the run's own."""
    hub: HubAddress | None = None
    """Where it is the hub, with the hub's credentials; None if it is none."""
    sessions: int = 0
    """How many may connect to that."""
    deaf: str = ""
    """Why an earlier intake of the run is gone; empty: there was none."""

    async def run(self, part: PartContext) -> None:
        """Take in readings until the end.

        Raises:
            NeurosnapError: The journal cannot be read or written.
        """
        with held(Path(self.folder), "journal"):
            await self._take_in(part)

    async def _take_in(self, part: PartContext) -> None:
        options = self.options
        journal = Journal(Path(self.folder), options.body.own, self.deaf)
        source = open_live(
            options.source,
            options.arguments,
            part.connection,
            journal=journal,
            most=options.ticks,
        )
        socket = Path(self.address)
        try:
            for old in socket.parent.iterdir():  # what an earlier intake left
                old.unlink()
            async with self._routing():
                await self._listen(source, part)
        finally:
            # The folder is the run's own; a launcher that was killed cannot remove it.
            await asyncio.to_thread(shutil.rmtree, socket.parent, ignore_errors=True)
        part.reporter.done(source.statistics())

    def _routing(self) -> contextlib.AbstractAsyncContextManager[None]:
        """Run the hub, if the intake is one."""
        if self.hub is None:
            return contextlib.nullcontext()
        return routing(self.hub, self.sessions)

    async def _listen(self, source: LiveSource, part: PartContext) -> None:
        """Take readings in, and answer worlds, until the end."""
        worlds = _WorldServer(source)
        try:
            server = await asyncio.start_unix_server(worlds.serve, self.address)
            # From now on: a program need not wait until there is a world.
            worlds.leave()
            async with synced(source, self.options.sync):
                part.reporter.ready()
                await part.stop.wait()
                launcher = multiprocessing.parent_process()
                source.over = launcher is None or launcher.is_alive()
            server.close()
        finally:
            await asyncio.to_thread(source.close)
            await worlds.wait_closed()


async def run_journaled(request: RunRequest, work: Work) -> Outcome:
    """Run `work`, and keep what comes from outside until it is recorded.

    Args:
        request: What to run. Where it is not recorded, nothing is kept. Where it goes
            on from an earlier run, what is in the journal beside that recording comes
            first; that journal stays as it is.
        work: The run.

    Returns:
        The outcome, and what was lost of what came in.

    Raises:
        InvalidValueError: A journal of an earlier run is beside the recording.
        NeurosnapError: The journal cannot be written; and as from `work`.
    """
    options, log = request.options, request.log
    if log is None or not is_live(options.source):
        return await work(request)
    folder = journal_of(log)
    if folder.exists():
        rule = "must be taken away first: it holds what came in for an earlier run"
        raise InvalidValueError("journal", rule, str(folder))
    if request.past is not None:
        await asyncio.to_thread(_take_over, folder, options, request.past)
    try:
        if options.cells == "inline" or "world" in request.site.elsewhere:
            way_in = WayIn(journal=str(folder))
            outcome = await work(replace(request, way_in=way_in))
        else:
            outcome = await _with_intake(request, folder, work)
    except BaseException:
        _warn_of(folder)
        raise
    outcome = await asyncio.to_thread(_delete_if_recorded, folder, outcome)
    lost = lost_by(options.source, outcome.intake)
    return msgspec.structs.replace(outcome, lost=lost)


def _take_over(folder: Path, options: RunOptions, past: ResumePoint) -> None:
    """Begin a journal with the readings that came after a tick and are not recorded."""
    log = Path(past.log)
    kept = read_journal(journal_of(first_path(log, past.part)))
    rows = [row for row in kept.rows if row.number > past.tick]
    new = Journal(folder, options.body.own, run=kept.run)
    with contextlib.closing(new) as journal:
        journal.restart(past.tick, rows, past.received, kept.taken)


def _delete_if_recorded(folder: Path, outcome: Outcome) -> Outcome:
    """Delete a journal, if all that is in it is recorded."""
    kept, last = read_journal(folder), outcome.totals.ticks
    if outcome.intake is None:  # what counted it has died
        intake = Statistics.of(kept.taken.received, kept.received.shown, deaf=True)
        outcome = msgspec.structs.replace(outcome, intake=intake)
    if outcome.complete and not any(row.number > last for row in kept.rows):
        remove(folder)
        return outcome
    waiting = kept.shown_after(last)
    return msgspec.structs.replace(outcome, journal=str(folder), waiting=waiting)


def _warn_of(folder: Path) -> None:
    """Warn that a journal is left, or delete it if it is empty."""
    with contextlib.suppress(NeurosnapError):
        kept = read_journal(folder)
        if kept.rows or kept.taken.readings:
            _logger.warning(
                "%s: holds what came in; `neurosnap resume` takes it in", folder
            )
        else:
            remove(folder)


async def _with_intake(request: RunRequest, folder: Path, work: Work) -> Outcome:
    """Run `work` with a process that takes readings in."""
    options = request.options
    with tempfile.TemporaryDirectory(prefix="neurosnap-") as own:
        job = IntakeJob(options, str(folder), f"{own}/{INTAKE}")
        connection = PartConnection(INTAKE, "")
        if options.source == ZENOH:
            request, job, connection = _with_hub(request, job, own)
        ready, ending = asyncio.Event(), asyncio.Event()
        keeping = asyncio.create_task(
            _keep_up(job, connection, ready, ending), name="kept/intake"
        )
        waiting = asyncio.create_task(ready.wait(), name="kept/ready")
        try:
            await asyncio.wait((waiting, keeping), return_when=asyncio.FIRST_COMPLETED)
            if keeping.done():
                keeping.result()  # why it cannot be
            way_in = WayIn(journal=str(folder), address=job.address)
            outcome = await work(replace(request, way_in=way_in))
        finally:
            waiting.cancel()
            ending.set()
            await asyncio.wait((keeping,))
    return msgspec.structs.replace(outcome, intake=keeping.result())


def _with_hub(
    request: RunRequest, job: IntakeJob, folder: str
) -> tuple[RunRequest, IntakeJob, PartConnection]:
    """Let the intake be the hub that programs put readings to, unless another is.

    Returns:
        The request, whose swarms connect to that hub; the intake's job; and how its
        source connects.
    """
    site, options = request.site, request.options
    site = replace(site, swarm=site.swarm or new_swarm_id())
    network = site.network
    if not network.connect:
        network.check()
        own = f"unixsock-stream/{folder}/hub"
        hub = HubAddress(
            network.endpoint("hub", own), network.credentials("hub"), network.insecure
        )
        sessions = (options.sharing or len(options.sensors)) + SERVICES
        job = msgspec.structs.replace(job, hub=hub, sessions=sessions)
        near = network.endpoint("world", own)
        network = msgspec.structs.replace(network, listen="", connect=near)
    site = replace(site, network=network)
    there = Connections(network).to("world", site.swarm).address
    connection = PartConnection(INTAKE, site.swarm, there)
    return replace(request, site=site), job, connection


async def _keep_up(
    job: IntakeJob,
    connection: PartConnection,
    ready: asyncio.Event,
    ending: asyncio.Event,
) -> Statistics | None:
    """Start the intake, again whenever it dies, until `ending`; return what it counted.

    None if it died in the end. How often is for the run to bound: a world that asks
    dies with it.
    """
    while True:
        try:
            async with Supervisor() as supervisor:
                child = await supervisor.start(job, connection)
                await supervisor.wait(child.ready, ending)
                ready.set()
                await supervisor.wait(ending)
                await supervisor.end([INTAKE], _GRACE)
                if child.result is None:
                    return None
                return msgspec.json.decode(child.result, type=Statistics)
        except PartDiedError as error:
            _logger.warning("%s (it is started again)", error)
            if ending.is_set():
                return None
            job = msgspec.structs.replace(job, deaf=str(error))
        await wait_any(ending, seconds=_AGAIN)


class _WorldServer:
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
        with contextlib.closing(writer):
            async with self._turn:
                await self._arrive()
                try:
                    with contextlib.suppress(ConnectionError, EOFError):
                        await self._converse(reader, writer)
                finally:
                    self.leave()

    def leave(self) -> None:
        """Journal changes while no world asks for them."""
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
            self._source.wake_reader()
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
        """Answer one question, on another thread: it may wait long."""
        source = self._source
        try:
            if isinstance(question, remote_source.IntakeRecall):
                known = pack_known(source.resume_after(question.tick))
                return JournalRow(question.tick, b"", known)
            action = question.action
            seen = source.step(action) if source.given else source.first()
        except NeurosnapError as error:
            return remote_source.IntakeFailed(str(error))
        if seen is None:
            return remote_source.Over()
        return JournalRow.of(seen, source.given)

    async def wait_closed(self) -> None:
        """Wait until the world has heard that the source is closed, but not long."""
        for task in (*self._serving, self._keeping):
            if task is not None and not task.done():
                await asyncio.wait((task,), timeout=_LAST)


async def _question(reader: asyncio.StreamReader) -> remote_source.Question:
    """Return the next question."""
    head = remote_source.HEAD
    (length,) = head.unpack(await reader.readexactly(head.size))
    return remote_source.questions.decode(await reader.readexactly(length))
