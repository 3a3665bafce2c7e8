"""Compiles a run's code before its parts start: in one process, once per machine.

Each part that needs compiled code would compile it by itself, all at the same time, and
on a small machine take longer than parts may take to come up.
"""

import asyncio
import os
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from neurosnap.agent import clone_kernels
from neurosnap.agent.body import Body
from neurosnap.errors import NothingBegunError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker_kernels import warm
from neurosnap.runtime.inline_tasks import InlineTasks
from neurosnap.runtime.launch import jobs_of, launch
from neurosnap.runtime.parts.job import PartConnection, PartContext
from neurosnap.runtime.request import RunRequest, Site
from neurosnap.runtime.supervisor import Supervisor
from neurosnap.system.compiled import cache_folder, interpreted

_ALIKE = ("snapshot", "threshold", "cells", "watch")
"""The options that say what is compiled."""
_LONG = 86_400.0  # seconds: nothing is late while it compiles
_HEAD = "a,b,c,d\n"
_ROWS = "0,0,0,0\n1,1,0,0\n0,1,0,1\n0,1,,1\n1,1,1,0\n0,0,1,0\n1,1,0,1\n"
"""Implications come and go, twins part twice, and one reading is unknown."""
_REPEATS = 12
"""So often, where windows are grown: until the first search for one."""


class CompileJob(msgspec.Struct, frozen=True):
    """Compiles a run's code by a short run of the same kind in memory."""

    options: RunOptions | None
    """Of the run; None for what workers need, whatever the run."""

    async def run(self, part: PartContext) -> None:
        """Compile until all is done or `part.stop` is set."""
        with TemporaryDirectory(prefix="neurosnap-") as folder:
            if self.options is None:
                warm()
            else:
                table = Path(folder) / "readings.csv"
                grows = _grows_windows(self.options)
                text = _HEAD + _ROWS * (_REPEATS if grows else 1)
                await asyncio.to_thread(table.write_text, text)
                like = {name: getattr(self.options, name) for name in _ALIKE}
                body = Body(own=("a", "b", "c", "d"), room=int(grows))
                like |= {"source": str(table), "body": body, "deadline": _LONG}
                request = RunRequest(RunOptions(**like), site=Site(patience=_LONG))
                jobs, site = jobs_of(request), request.site
                if self.options.body.room and self.options.body.context:
                    clone_kernels.warm()
                with interpreted(0.0):
                    await launch(jobs, site, part.stop, starter=InlineTasks())
        part.reporter.done()


async def compile_first(options: RunOptions | None, stop: asyncio.Event) -> None:
    """Compile what a run needs, unless that is compiled; as long as it takes.

    Where there is no folder to keep it in, nothing is compiled here: each part does.
    The options are as for `CompileJob`.

    Raises:
        NothingBegunError: `stop` was set before all was compiled.
        SwarmError: It failed.
    """
    if (cache := cache_folder()) is None:
        return
    note = cache / f"compiled-{await asyncio.to_thread(_made_from, options)}"
    if note.exists():
        return
    async with Supervisor() as supervisor:
        part = await supervisor.start(
            CompileJob(options), PartConnection("compiler", "")
        )
        await supervisor.wait(stop, part.ended)
        if not part.ended.is_set():
            raise NothingBegunError("run: must be compiled first, got a stop request")
    note.touch()


def _grows_windows(options: RunOptions) -> bool:
    return options.body.room > 0 and not options.body.context


def _made_from(options: RunOptions | None) -> str:
    """Return a digest of all that makes compiled code another one."""
    compiler = find_spec("numba")
    files = list(Path(__file__).parents[1].rglob("*.py"))
    files.append(Path(str(compiler and compiler.origin)))
    changed = sorted((str(path), path.stat().st_mtime_ns) for path in files)
    kind = options and [
        bool(options.body.room),
        bool(options.body.context),
        *(getattr(options, name) for name in _ALIKE),
    ]
    return sha256(repr([kind, os.uname(), changed]).encode()).hexdigest()[:16]
