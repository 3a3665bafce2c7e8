"""A swarm over two hosts, set up as in the docs, with both on loopback."""

import re
import shlex
import signal
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.view_commands import Verb, done, verb

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

# The page "a swarm on two hosts": its commands, in its order, and what they say

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorials/two_hosts.md").read_text()
COMMANDS = re.findall(r"^\$ neurosnap (.*)$", PAGE, re.MULTILINE)
SHOWN = dict(re.findall(r"^\$ neurosnap (.*)\n((?:[^$`].*\n)*)", PAGE, re.MULTILINE))


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
