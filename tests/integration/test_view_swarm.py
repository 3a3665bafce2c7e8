"""A real swarm of processes, viewed in a browser while it runs."""

import asyncio
import json
import random
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.support.browser_pages import IN_BROWSER, looked_at, states, worded
from tests.support.patience import PATIENCE
from tests.support.recorded_messages import assert_true_run
from tests.support.view_commands import Verb, address_of, done, verb
from tools.browser import wait_shown

pytestmark = [pytest.mark.zenoh, *IN_BROWSER]
NAMES = ("a", "b", "c")
FIRST, LAST = 30, 40


def readings() -> list[list[bool | None]]:
    """Return what is read: ``a`` implies ``b``, and in the end not all is known."""
    chance = random.Random(1)
    rows: list[list[bool | None]] = []
    for tick in range(1, LAST + 1):
        a, either = chance.random() < 0.5, chance.random() < 0.5
        rows.append([a, a or either, tick % 3 == 0])
    rows[-2:] = [[True, False, None], [True, None, None]]
    return rows


async def ended(process: Verb) -> tuple[int | None, str]:
    """End a command as Ctrl-C does; return its exit code and what it complained of."""
    process.send_signal(signal.SIGINT)
    complaints = await process.stderr.read()
    return await process.wait(), complaints.decode()


def feed(process: Verb, rows: Sequence[Sequence[bool | None]]) -> None:
    for row in rows:
        process.stdin.write(json.dumps({"bits": row}).encode() + b"\n")


async def follow(run: Verb, page: Page, address: str) -> dict[int, list[str]]:
    """Feed a run tick by tick while the page looks on; return what it showed."""
    rows, seen = readings(), {}
    feed(run, rows[:1])
    await page.goto(address)
    badge = page.locator("#badge")
    await expect(badge).to_have_text("live")
    await page.click("#tab-sensors")
    for before, now in [(1, FIRST), (FIRST, LAST - 1), (LAST - 1, LAST)]:
        feed(run, rows[before:now])
        await wait_shown(page, now)
        seen[now] = await states(page, now)
    run.stdin.close()
    await expect(badge).to_have_text(f"ended at tick {LAST}", timeout=PATIENCE * 1000)
    await expect(page.locator("#notice")).to_be_hidden()
    return seen


@pytest.mark.parametrize("way", ["run --view", "view"])
async def test_a_swarm_is_followed_to_its_end(tmp_path: Path, way: str) -> None:
    log = tmp_path / "run.mcap"
    names = ("--set", f"sensors={','.join(NAMES)}", "--threshold", "0.1")
    spread = ("--workers", "2") if way == "view" else ()
    options = ("run", "-", *names, *spread, "--out", str(log))
    async with asyncio.timeout(PATIENCE):
        if way == "run --view":
            async with verb(tmp_path, *options, "--view") as run:
                address = await address_of(run)
                async with looked_at(address) as page:
                    seen = await follow(run, page, address)
                known = "learning: 0 of about 60 changes; 0 of 3 sensors known"
                code, said = await ended(run)
                told = [line for line in said.splitlines() if "is late" not in line]
                assert (code, told) == (0, [known])
        else:
            async with verb(tmp_path, *options) as run:
                run.stdin.write(b"nonsense\n")
                # It may be taken in before the swarm can be found.
                while "no swarm runs here" in await done(tmp_path, "ps"):
                    assert run.returncode is None
                async with verb(tmp_path, "view", "--no-browser") as viewing:
                    address = await address_of(viewing)
                    async with looked_at(address) as page:
                        seen = await follow(run, page, address)
                    assert await run.wait() == 3  # one line was no reading
                    assert await ended(viewing) == (0, "")
    assert_true_run(log, ticks=LAST)
    truth = worded(log)
    assert seen == {tick: truth[tick] for tick in seen}
    assert seen[LAST - 1][:2] == ["contradicted", "contradicted"]
    assert seen[LAST][:2] == ["on", "on"]
