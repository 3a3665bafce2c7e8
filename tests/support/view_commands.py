"""Commands of `neurosnap` in processes of their own, and what they say."""

import asyncio
import os
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path


@asynccontextmanager
async def verb(folder: Path, *arguments: str) -> AsyncIterator[Process]:
    """A command, with files, notes and a browser of this test's own."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "neurosnap", *arguments),
        stdin=PIPE,
        stdout=PIPE,
        stderr=PIPE,
        cwd=folder,
        env={**os.environ, "XDG_RUNTIME_DIR": str(folder), "BROWSER": "true"},
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.communicate()


async def address_of(process: Process) -> str:
    """Return where the page is that a command says it serves."""
    assert process.stdout is not None
    said = (await process.stdout.readline()).decode()
    assert "http://127.0.0.1:" in said
    return said[said.index("http://") :].strip()
