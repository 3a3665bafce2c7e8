"""The health of sensors on the page, in a real browser."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.run import run
from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.lived_in import SENSORS, lived_in
from tests.support.rewritten_recordings import sent_at

pytestmark = IN_BROWSER

FLUSH = SENSORS.index("flush")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a home whose flush rests from the fourteenth day on."""
    folder = tmp_path_factory.mktemp("home")
    spans = lived_in(17, 1)
    rests = spans[0][0] // 86400 * 86400 + 14 * 86400
    spans = [each for each in spans if each[2] != FLUSH or each[0] < rests]
    edges = sorted({at for on, off, _ in spans for at in (on, off)})
    rows = [
        ",".join(
            str(int(sensor in {k for a, b, k in spans if a <= at < b}))
            for sensor in range(len(SENSORS))
        )
        for at in edges
    ]
    table = folder / "home.csv"
    table.write_text("\n".join([",".join(SENSORS), *rows]) + "\n")
    options = RunOptions(
        source=str(table),
        body=Body(own=SENSORS),
        cells="inline",
        ticks=len(rows),
        alarms="1/week",
    )
    path = folder / "home.mcap"
    asyncio.run(run(options, path, asyncio.Event()))
    return sent_at(path, folder / "then.mcap", edges)


async def test_the_alarms_are_counted_on_the_tab_and_told_behind_it(log: Path) -> None:
    async with opened(log) as page:
        tab = page.locator("#tab-health")
        await expect(tab).to_have_text("Health: 1 alarm")
        await tab.click()
        home = page.locator("#health")
        await expect(home).to_contain_text("; 8 of 8 sensors known")
        await expect(home.locator(".alarm")).to_contain_text("flush: silent since ")
        rows = home.locator("tbody tr")
        await expect(rows).to_have_count(8)
        await expect(rows.nth(FLUSH)).to_contain_text("in alarm")
