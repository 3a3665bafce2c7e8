"""The page of a run as one file, opened in a browser without any network."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer.page_file import write_page
from tests.support.browser_pages import IN_BROWSER, go_to, looked_at, states, worded
from tools.browser import wait_shown

pytestmark = [*IN_BROWSER, pytest.mark.slow]
BROKEN = 25  # the last tick with an anomaly


async def test_a_file_does_what_the_page_does(broken_log: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.html"
    write_page(broken_log, file)
    truth = worded(broken_log)
    async with looked_at(file.as_uri()) as page:
        await page.context.set_offline(True)
        await page.goto(f"{file.as_uri()}#t=20")
        await wait_shown(page, 20)
        await page.click("#tab-sensors")
        for tick in (20, 1, 60):
            await go_to(page, tick)
            assert await states(page, tick) == truth[tick]
        # The marks, and from one to the next.
        await expect(page.locator("#strip .anomalies")).not_to_have_count(0)
        await page.click("#anomaly-back")
        await wait_shown(page, BROKEN)
        await expect(page.locator("#finding")).to_contain_text("a is on while b")
        # A sensor, those around it, and what speaks for an edge.
        nodes = page.locator("#drawing .node")
        every = await nodes.count()
        await page.locator("#outline tbody button").first.click()
        await page.locator("#choice button.link").first.click()
        await expect(page.locator("#edge td").first).not_to_have_text("–")
        await expect(page.locator("#choice-body")).to_contain_text("tested on")
        await page.locator("#outline tbody button").nth(2).click()
        await page.select_option("#focus-depth", "1")
        await page.click("#focus-alone")
        await expect(nodes).not_to_have_count(every)
        # A wave.
        await page.locator("#depths-dots rect").last.click()  # none is above it
        await expect(page.locator("#wave-play")).to_have_text("Show state")
        # What was over time.
        await go_to(page, BROKEN)
        await page.click("#tab-raster")
        await page.focus("#raster canvas[aria-label]")  # drawn: keys are taken
        await page.keyboard.press("ArrowRight")
        await expect(page.locator("#raster")).to_contain_text("a, tick 26: o")
        await page.click("#tab-compare")
        await expect(page.locator("#compare")).to_contain_text("tick 24")
        await page.fill("#compare input", "3")
        await expect(page.locator("#compare")).to_contain_text("not in the file")


async def test_a_browser_that_cannot_unpack_it_says_so(
    broken_log: Path, tmp_path: Path
) -> None:
    file = tmp_path / "a.html"
    write_page(broken_log, file)
    async with looked_at(file.as_uri()) as page:
        await page.add_init_script("delete window.DecompressionStream")
        await page.goto(file.as_uri())
        await expect(page.locator("body")).to_contain_text("no DecompressionStream")
