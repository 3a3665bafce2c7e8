"""A swarm over two hosts, set up as in the docs, with both on loopback."""

import re
import shlex
import signal
from pathlib import Path

import pytest

from tests.support.command_line import refused
from tests.support.ports import free_port
from tests.support.view_commands import Verb, verb

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

# The page "a swarm on two hosts": its commands, in its order, and what they say

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorials/two_hosts.md").read_text()
COMMANDS = re.findall(r"^\$ neurosnap (.*)$", PAGE, re.MULTILINE)
SHOWN = dict(re.findall(r"^\$ neurosnap (.*)\n((?:[^$`].*\n)*)", PAGE, re.MULTILINE))


async def done(folder: Path, line: str) -> list[str]:
    """Run a command to its end; return what it said."""
    async with verb(folder, *shlex.split(line)) as process:
        output, errors = await process.communicate()
        assert process.returncode == 0, f"{line}: {errors.decode()}"
    return [each.rstrip() for each in output.decode().splitlines()]


async def told(process: Verb, line: str) -> None:
    """Wait until a command that goes on says a line."""
    while said := (await process.stderr.readline()).decode():
        if said.strip() == line:
            return
    pytest.fail(f"ended without {line!r}")


async def test_the_page_runs(tmp_path: Path) -> None:
    port = str(free_port())
    keys, hub, join, run, verify = [line.replace("7447", port) for line in COMMANDS]
    listening, joined = [
        SHOWN[line].strip().replace("7447", port) for line in COMMANDS[1:3]
    ]
    said = await done(tmp_path, keys)
    assert SHOWN[COMMANDS[0]].strip() in said
    async with verb(tmp_path, *shlex.split(hub)) as hubs:
        await told(hubs, listening)
        async with verb(tmp_path, *shlex.split(join)) as cells:
            await told(cells, joined)
            said = await done(tmp_path, run)
            shown = SHOWN[COMMANDS[3]].splitlines()
            assert len(shown) == 5
            assert [line for line in shown if line not in said] == []
            assert await cells.wait() == 0
        hubs.send_signal(signal.SIGINT)
        assert await hubs.wait() == 0
    assert any(line.startswith("same:") for line in await done(tmp_path, verify))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--elsewhere", "1"), "elsewhere: must come with --swarm ID"),
        (
            ("--elsewhere", "9", "--swarm", "a", "--listen", "tcp/127.0.0.1:7447"),
            "elsewhere: must be cells of the swarm, 0 to 5, got '9'",
        ),
        (
            ("--elsewhere", "x", "--swarm", "a", "--listen", "tcp/127.0.0.1:7447"),
            "elsewhere: must be like 0-499 or 3,7,9-12, of at most six digits, got 'x'",
        ),
        (("--swarm", "a/b"), "swarm: must be letters and digits, got 'a/b'"),
        (
            ("--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:2"),
            "connect: must not come with an endpoint to listen on",
        ),
        (("--connect", "tcp/192.0.2.1:7447"), "connect: must be tcp/ on loopback"),
    ],
)
def test_what_cannot_be_shared_is_refused(
    options: tuple[str, ...], text: str, tmp_path: Path
) -> None:
    small = ("neurosnap/Path-v0", "--set", "places=7", "--out", tmp_path / "log")
    assert text in refused("run", *small, *options)
    assert not (tmp_path / "log").exists()
