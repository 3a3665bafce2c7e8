"""``neurosnap watch``: on a swarm that runs, and on a recording."""

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.view_commands import Verb, verb

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]

REGULAR = [(0, 0), (0, 1), (1, 1)] * 4


def tell(run: Verb, door: int, motion: int) -> None:
    line = json.dumps({"bits": {"door": door, "motion": motion}})
    run.stdin.write(f"{line}\n".encode())


async def listed(folder: Path) -> list[str]:
    """Return the ids of the swarms that are up."""
    async with verb(folder, "ps", "--format", "json") as process:
        output, _ = await process.communicate()
    return [note["swarm"] for note in json.loads(output)["swarms"]]


async def broken(said: asyncio.StreamReader, implication: str) -> dict[str, Any]:
    """Return the first anomaly that breaks an implication.

    Who is there early also hears of those that the first ticks broke.
    """
    while True:
        found: dict[str, Any] = json.loads(await said.readline())
        if implication in (link["implication"] for link in found["broken"]):
            return found


@pytest.mark.parametrize("cells", ["process", "worker"])
async def test_a_running_swarm_is_looked_on_until_its_end(
    tmp_path: Path, cells: str
) -> None:
    log = tmp_path / "log.mcap"
    arguments = ("--cells", cells, "--workers", "1", "--threshold", "0.25")
    async with verb(tmp_path, "run", "-", *arguments, "--out", str(log)) as run:
        for door, motion in REGULAR:
            tell(run, door, motion)
        while not await listed(tmp_path):
            assert run.returncode is None
        async with verb(tmp_path, "watch", "--format", "json") as watch:
            assert b"watching" in await watch.stderr.readline()
            exception = asyncio.create_task(broken(watch.stdout, "door -> motion"))
            while not exception.done():
                # Rare enough to be an exception still; the first may be too early for
                # it to be heard.
                for door, motion in REGULAR:
                    tell(run, door, motion)
                tell(run, 1, 0)
                await run.stdin.drain()
                await asyncio.wait({exception}, timeout=0.5)
            assert set(exception.result()["candidates"]) == {"door", "motion"}
            run.stdin.close()
            output, errors = await watch.communicate()
            assert watch.returncode == 0, errors
        output, errors = await run.communicate()
        assert run.returncode == 0, errors
    async with verb(tmp_path, "watch", str(log)) as again:
        output, _ = await again.communicate()
        assert b"may be wrong: breaks door -> motion" in output
