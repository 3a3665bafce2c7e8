"""Runs a source through a swarm: in processes, in tasks, or on a cluster."""

import asyncio
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.runtime.incarnation import run_incarnation
from neurosnap.runtime.journaled_run import run_journaled
from neurosnap.runtime.request import Outcome, RunRequest
from neurosnap.runtime.restart import run_with_restarts
from neurosnap.runtime.watcher import SILENT, Watcher
from neurosnap.sources.open import open_source

MORE = 300
"""Ticks that a resumed run adds unless asked otherwise."""


async def run(
    request: RunRequest, stop: asyncio.Event, watcher: Watcher = SILENT
) -> Outcome:
    """Run a swarm to its end, or until `stop` is set. No process outlives the call.

    What comes from outside is kept in a journal until it is recorded. When a part dies
    the run goes on from its recording, as often as its supervision allows; an inline
    run, or one without a recording, ends.

    Args:
        request: What is run, and where.
        stop: Ends the run in order.
        watcher: What is reported meanwhile.

    Raises:
        InvalidValueError: There are more sensors than a key-frame can hold; or files of
            an earlier run are beside the recording.
        PartDiedError: A part died, more often than allowed.
        NeurosnapError: A part failed; the text names it. Whatever was recorded until
            then is readable.
    """

    async def work(kept: RunRequest) -> Outcome:
        alone = kept.log is None or kept.options.cells == "inline"
        if kept.supervision is None or alone:
            return await run_incarnation(kept, stop, watcher)
        return await run_with_restarts(kept, stop, watcher)

    return await run_journaled(request, work)


def resumed(log: Path, ticks: int | None = None) -> RunRequest:
    """Return the request that goes on with a recorded run after its last whole tick.

    It does not say where to record.

    Args:
        log: The recording; it stays as it is.
        ticks: How many ticks there are to be in all; None: 300 more than there are, or
            as many as the source has.

    Raises:
        InvalidValueError: There are so many ticks already, or the source has no more.
        NeurosnapError: There is nothing to go on from.
    """
    options, past = find_resume_point(log)
    source = open_source(options.source, options.seed, options.arguments)
    source.close()
    most = past.tick + MORE if ticks is None else ticks
    if source.length is not None:
        most = min(most, source.length)
    if most <= past.tick:
        rule = f"must be more than the {past.tick} there are, and the source have them"
        raise InvalidValueError("ticks", rule, most)
    return RunRequest(msgspec.structs.replace(options, ticks=most), past=past)
