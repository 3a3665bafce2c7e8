"""A run's code is compiled once, by one process, before its parts start."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import pytest
from msgspec.structs import replace

from neurosnap.errors import NothingBegunError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import compilation
from neurosnap.runtime import run_with_restarts as runs
from neurosnap.runtime.request import RunRequest
from tests.support.restart_runs import options_of


class Compiler:
    """A supervisor whose only part ends when it is let."""

    def __init__(self) -> None:
        self.started: list[str] = []
        self.begun, self.ended = asyncio.Event(), asyncio.Event()

    def __call__(self) -> Self:
        return self

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    async def start(self, job: object, connection: Any) -> object:
        self.started.append(connection.who)
        self.begun.set()
        return SimpleNamespace(ended=self.ended)

    async def wait(self, *events: asyncio.Event) -> None:
        waits = [asyncio.create_task(event.wait()) for event in events]
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        for each in waits:
            each.cancel()


@pytest.fixture
async def compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Compiler:
    compiler = Compiler()
    monkeypatch.setattr(compilation, "Supervisor", compiler)
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    return compiler


async def test_no_part_starts_before_all_is_compiled_and_it_is_compiled_once(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    async def begin(*_: object) -> str:
        begun.append(list(compiler.started))
        return "done"

    monkeypatch.setattr(runs, "run_journaled", begin)
    cells = RunRequest(replace(options_of(3), cells="process"))
    few = await runs.run(cells, asyncio.Event())
    assert begun == [[]]
    request = RunRequest(options_of(3))
    running = asyncio.create_task(runs.run(request, asyncio.Event()))
    await compiler.begun.wait()
    assert begun == [[]]
    compiler.ended.set()
    assert await running == await runs.run(request, asyncio.Event()) == few
    assert begun == [[], ["compiler"], ["compiler"]]


async def test_a_stop_request_ends_it_and_the_next_run_compiles(
    compiler: Compiler,
) -> None:
    stop = asyncio.Event()
    stop.set()
    for _ in range(2):
        with pytest.raises(NothingBegunError):
            await compilation.compile_first(options_of(3), stop)
    assert compiler.started == ["compiler", "compiler"]


@pytest.mark.slow
@pytest.mark.zenoh
@pytest.mark.parametrize("snapshot", ["empirical", "discounted"])
def test_few_cells_need_no_compiler_and_say_the_same(
    tmp_path: Path, snapshot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, cache = str(tmp_path / "a.mcap"), tmp_path / "cache"
    flags = f"--set places=6 --ticks 90 --snapshot {snapshot} --out {log}"
    for line in (
        f"run neurosnap/Path-v0 {flags}",
        f"verify {log}",
        f"export {log} --out {log}.html",
        f"resume {log} --ticks 99 --out {log[:-6]}b.mcap",
    ):
        done = subprocess.run(
            [sys.executable, "-m", "neurosnap", *line.split()],
            env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    made = {path.name.partition("-")[0] for path in cache.rglob("*.nbi")}
    assert made <= {"chunk_index._walk"}  # to find where a run goes on
    # What was compiled comes to the same.
    monkeypatch.setattr(RunOptions, "briefly", 0.0)
    assert verify(Path(log)).same


REHEARSED = """
import asyncio
import sys
from neurosnap.runtime.compilation import CompileJob
from neurosnap.runtime.inline_tasks import InlineTasks
from neurosnap.runtime.launch import jobs_of, launch
from neurosnap.runtime.parts.job import PartContext, Reporter
from neurosnap.runtime.request import RunRequest, Site
from neurosnap.system import compiled
from tests.support.run_options import options_for

class Line:
    def send_bytes(self, said):
        pass

def signatures():
    made = [one for one in compiled._kernels if one._dispatcher is not None]
    return {(one.__name__, str(key)) for one in made for key in one._dispatcher.overloads}

given = dict(pair.split("=") for pair in sys.argv[1:])
options = options_for("neurosnap/Path-v0", 1, {"places": 6}, ticks=60, **given)
part = PartContext(None, asyncio.Event(), Reporter("compiler", Line()))
asyncio.run(CompileJob(options).run(part))
before = signatures()
assert before
jobs = jobs_of(RunRequest(options))
with compiled.interpreted(0.0):
    asyncio.run(launch(jobs, Site(), asyncio.Event(), starter=InlineTasks()))
assert signatures() == before, signatures() - before
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        pytest.param(["cells=worker"], id="workers"),
        pytest.param(["cells=process"], id="cells", marks=pytest.mark.exhaustive),
        pytest.param(
            ["cells=inline", "snapshot=discounted"],
            id="discounted",
            marks=pytest.mark.exhaustive,
        ),
    ],
)
def test_a_run_needs_nothing_that_was_not_compiled_before(given: list[str]) -> None:
    program = [sys.executable, "-c", REHEARSED, *given]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
