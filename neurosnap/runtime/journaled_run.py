"""Runs a swarm with a live source whose readings are journaled until recorded.

The journal lies beside the recording. When the run ends in order, and all that came is
in the recording, it is deleted; otherwise it stays, and a run that is resumed from the
recording gets what is in it.
"""

import asyncio
import contextlib
import logging
import tempfile
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError, NeurosnapError, PartDiedError
from neurosnap.fabric.events import wait_at_most
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import first_path
from neurosnap.runtime.parts.intake_process import INTAKE, IntakeJob, Taken
from neurosnap.runtime.parts.job import PartConnection
from neurosnap.runtime.parts.world_process import WayIn
from neurosnap.runtime.request import Outcome, RunRequest
from neurosnap.runtime.supervisor import Supervisor
from neurosnap.sources.live.journal import Journal, journal_of, read_journal, remove
from neurosnap.sources.open import ZENOH, is_live

_GRACE = 10.0  # seconds the intake may take to end
_AGAIN = 0.1  # seconds before it is started again

_logger = logging.getLogger(__name__)

Work = Callable[[RunRequest], Awaitable[Outcome]]
"""Runs the swarm; the request says how outside readings get to its world."""


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
    inside = options.source == ZENOH or options.cells == "inline"
    try:
        if inside:
            way_in = WayIn(journal=str(folder))
            outcome = await work(replace(request, way_in=way_in))
        else:
            outcome = await _with_intake(request, folder, work)
    except BaseException:
        _tell(folder)
        raise
    return await asyncio.to_thread(_let_go, folder, outcome)


def _take_over(folder: Path, options: RunOptions, past: ResumePoint) -> None:
    """Begin a journal with the readings that came after a tick and are not recorded."""
    log = Path(past.log)
    kept = journal_of(first_path(log, past.part) if past.part else log)
    rows = [row for row in read_journal(kept).rows if row.number > past.tick]
    with contextlib.closing(Journal(folder, options.body.own)) as journal:
        journal.restart(past.tick, rows)


def _let_go(folder: Path, outcome: Outcome) -> Outcome:
    """Delete a journal, if all that is in it is recorded."""
    rows = read_journal(folder).rows
    waiting = [row for row in rows if row.number > outcome.totals.ticks]
    if outcome.complete and not waiting:
        remove(folder)
        return outcome
    return msgspec.structs.replace(outcome, journal=str(folder), waiting=len(waiting))


def _tell(folder: Path) -> None:
    """Say that a journal is left, if there is anything in it."""
    with contextlib.suppress(NeurosnapError):
        if read_journal(folder).rows:
            _logger.warning(
                "%s: holds what came in; `neurosnap resume` takes it in", folder
            )
        else:
            remove(folder)


async def _with_intake(request: RunRequest, folder: Path, work: Work) -> Outcome:
    """Run `work` with a process that takes readings in."""
    with tempfile.TemporaryDirectory(prefix="neurosnap-") as socket:
        address = f"{socket}/{INTAKE}"
        ready, ending = asyncio.Event(), asyncio.Event()
        keeping = asyncio.create_task(
            _keep_up(request.options, folder, address, ready, ending),
            name="kept/intake",
        )
        waiting = asyncio.create_task(ready.wait(), name="kept/ready")
        try:
            await asyncio.wait((waiting, keeping), return_when=asyncio.FIRST_COMPLETED)
            if keeping.done():
                keeping.result()  # why it cannot be
            way_in = WayIn(journal=str(folder), address=address)
            outcome = await work(replace(request, way_in=way_in))
        finally:
            waiting.cancel()
            ending.set()
            await asyncio.wait((keeping,))
    taken = keeping.result()
    return msgspec.structs.replace(outcome, lost=outcome.lost + taken.lost)


async def _keep_up(
    options: RunOptions,
    folder: Path,
    address: str,
    ready: asyncio.Event,
    ending: asyncio.Event,
) -> Taken:
    """Start the intake, and start it again when it dies, until `ending`.

    How often is for the run to bound: a world that asks dies with it.
    """
    job = IntakeJob(options, str(folder), address)
    connection = PartConnection(INTAKE, "", "")
    while True:
        try:
            async with Supervisor() as supervisor:
                child = await supervisor.start(job, connection)
                await supervisor.wait(child.ready, ending)
                ready.set()
                await supervisor.wait(ending)
                await supervisor.end([INTAKE], _GRACE)
                if child.result is None:
                    return Taken()
                return msgspec.json.decode(child.result, type=Taken)
        except PartDiedError as error:
            _logger.warning("%s (it is started again)", error)
            if ending.is_set():
                return Taken()
        await wait_at_most(ending, _AGAIN)
