"""Commands of `neurosnap` in separate processes, with asyncio streams."""

import asyncio
import os
import shlex
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TextIO

from tests.support.commands import Command
from tests.support.patience import PATIENCE


class Verb:
    """A command that runs, used as a `asyncio.subprocess.Process`."""

    def __init__(
        self,
        command: Command,
        stdin: asyncio.StreamWriter,
        stdout: asyncio.StreamReader,
        stderr: asyncio.StreamReader,
    ) -> None:
        self.stdin = stdin
        self.stdout = stdout
        self.stderr = stderr
        self._command = command

    @property
    def returncode(self) -> int | None:
        """Its exit code, or None if it goes on."""
        return self._command.poll()

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        self._command.send_signal(number)

    async def wait(self) -> int:
        """Wait for its end."""
        return await asyncio.to_thread(self._command.wait, PATIENCE)

    async def communicate(self) -> tuple[bytes, bytes]:
        """End its input, wait for its end; return what is left of what it said."""
        self.stdin.close()
        said = await _read_all(self.stdout, self.stderr)
        await self.wait()
        return said


@asynccontextmanager
async def verb(folder: Path, *arguments: str) -> AsyncIterator[Verb]:
    """A command, with files, notes and a browser of this test's own."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "BROWSER": "true"}
    with Command(*arguments, folder=folder, environment=environment) as command:
        stdout = await _reader(command.stdout)
        stderr = await _reader(command.stderr)
        stdin = await _writer(command.stdin)
        try:
            yield Verb(command, stdin, stdout, stderr)
        finally:
            command.kill()
            stdin.close()
            # The pipes are read to their end, which closes them.
            await _read_all(stdout, stderr)


async def done(folder: Path, line: str) -> list[str]:
    """Run a command line to its end; return what it said."""
    async with verb(folder, *shlex.split(line)) as process:
        output, errors = await process.communicate()
        assert process.returncode == 0, f"{line}: {errors.decode()}"
    return [each.rstrip() for each in output.decode().splitlines()]


async def address_of(process: Verb) -> str:
    """Return where the page is that a command says it serves."""
    said = (await process.stdout.readline()).decode()
    assert "http://127.0.0.1:" in said
    return said[said.index("http://") :].strip()


async def _reader(file: TextIO) -> asyncio.StreamReader:
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), file
    )
    return reader


async def _writer(file: TextIO) -> asyncio.StreamWriter:
    loop = asyncio.get_running_loop()
    transport, protocol = await loop.connect_write_pipe(
        lambda: asyncio.StreamReaderProtocol(asyncio.StreamReader()), file
    )
    return asyncio.StreamWriter(transport, protocol, None, loop)


async def _read_all(*readers: asyncio.StreamReader) -> tuple[bytes, bytes]:
    async with asyncio.TaskGroup() as group:
        output, errors = (group.create_task(one.read()) for one in readers)
    return output.result(), errors.result()
