"""Compiles the code of a run before its parts start, in one process, once a machine.

Each part that needs compiled code would compile it by itself, all at the same time, and
on a small machine take longer than parts may take to come up.
"""

import asyncio
import os
from collections.abc import Iterator
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from neurosnap.agent.body import Body
from neurosnap.errors import NothingBegunError
from neurosnap.health.budget import NEVER
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker_kernels import warm
from neurosnap.runtime.launch import run_incarnation
from neurosnap.runtime.parts.job import PartConnection, PartContext
from neurosnap.runtime.request import RunRequest, Site
from neurosnap.runtime.supervisor import Supervisor
from neurosnap.system.compiled import cache_folder

_LONG = 86_400.0  # seconds: the rehearsal has no deadlines
_READINGS = "a,b,c\n0,0,0\n1,1,0\n0,1,\n1,1,1\n0,0,1\n1,1,0\n"
"""Implications come and go, and one reading is unknown."""


class CompileJob(msgspec.Struct, frozen=True):
    """Compiles what a run needs, by a short run of the same kind in this process."""

    options: RunOptions | None
    """Of the run; None for what workers need, whatever the run."""

    async def run(self, part: PartContext) -> None:
        """Compile until all is done or `part.stop` is set."""
        if self.options is None:
            warm()
        else:
            with TemporaryDirectory(prefix="neurosnap-") as folder:
                table = Path(folder) / "readings.csv"
                await asyncio.to_thread(table.write_text, _READINGS)
                options = _rehearsed(self.options, table)
                request = RunRequest(options, site=Site(patience=_LONG))
                await run_incarnation(request, part.stop, inline=True)
        part.reporter.done()


def _rehearsed(options: RunOptions, table: Path) -> RunOptions:
    """Return a short run over a file which learns as another one does."""
    return RunOptions(
        source=str(table),
        body=Body(own=("a", "b", "c")),
        snapshot=options.snapshot,
        threshold=options.threshold,
        cells=options.cells,
        learning=options.learning,
        watch=options.watch,
        deadline=_LONG,
        alarms=NEVER,
    )


async def compile_first(options: RunOptions | None, stop: asyncio.Event) -> None:
    """Compile what a run needs, unless that is compiled; as long as it takes.

    Where there is no folder to keep it in, nothing is compiled here: each part does.

    Args:
        options: As for `CompileJob`.
        stop: Ends it.

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


def _made_from(options: RunOptions | None) -> str:
    """Return a digest of all that makes compiled code another one."""
    kind = ["workers"]
    if options is not None:
        kind = [options.cells, options.learning, options.snapshot, str(options.watch)]
    return sha256(repr([*kind, *os.uname(), *_sources()]).encode()).hexdigest()[:16]


def _sources() -> Iterator[tuple[str, int]]:
    """Yield Numba's and our files, and when each was changed."""
    compiler = find_spec("numba")
    ours = Path(__file__).parents[1].rglob("*.py")
    for path in [Path(str(compiler and compiler.origin)), *sorted(ours)]:
        yield str(path), path.stat().st_mtime_ns
