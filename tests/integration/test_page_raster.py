"""The raster of a run, in a real browser."""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from neurosnap.apps.viewer.run_view import RunView
from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.page_faults import faults
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

NAMES, HIGH = 170, 13  # pixels: the column of names, and a row
READ = 31  # ticks, of which the last has a sensor that is predicted


async def open_raster(page: Page) -> None:
    await page.click("#tab-raster")
    await page.wait_for_selector("#raster canvas[aria-label*=over]")


async def test_the_pointer_tells_each_value_and_a_click_goes_there(
    unread_log: Path,
) -> None:
    view = RunView(unread_log)
    names = view.options.sensors
    async with opened(unread_log, "#t=2") as page:
        await wait_shown(page, 2)
        await open_raster(page)
        canvas = page.locator("#raster canvas")
        await expect(canvas).to_have_attribute(
            "aria-label",
            f"3 sensors over ticks 1 to {view.last}. Arrows move, Enter goes there.",
        )
        box = await canvas.bounding_box()
        assert box is not None
        wide = (box["width"] - NAMES) / view.last
        says = page.locator("#raster [aria-live]")
        for tick, sensor, words in [
            (READ, 0, "on"),
            (READ, 1, "on, predicted"),
            (READ, 2, "unknown"),
            (READ + 1, 1, "contradicted"),
        ]:
            x, y = NAMES + wide * (tick - 0.5), HIGH * (sensor + 0.5)
            await canvas.hover(position={"x": x, "y": y})
            await expect(says).to_have_text(f"{names[sensor]}, tick {tick}: {words}")
        await canvas.click(position={"x": NAMES + wide * (READ - 0.5), "y": HIGH * 1.5})
        await wait_shown(page, READ)
        assert await page.inner_text("#choice-title") == names[1]


async def test_keys_move_and_go(unread_log: Path) -> None:
    names = RunView(unread_log).options.sensors
    async with opened(unread_log, "#t=20") as page:
        await wait_shown(page, 20)
        await open_raster(page)
        await page.focus("#raster canvas")
        await page.keyboard.press("ArrowDown")
        await page.keyboard.press("ArrowRight")
        says = page.locator("#raster [aria-live]")
        await expect(says).to_contain_text(f"{names[1]}, tick 21: ")
        await page.keyboard.press("Enter")
        await wait_shown(page, 21)
        assert await page.inner_text("#choice-title") == names[1]


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_axe_finds_no_fault_in_it(large_log: Path, scheme: Scheme) -> None:
    async with opened(large_log, "#t=3", scheme) as page:
        await wait_shown(page, 3)
        await open_raster(page)
        parts = page.get_by_label("Which sensors are shown")
        assert await parts.locator("option").all_inner_texts() == [
            "sensors 1 to 200",
            "sensors 201 to 400",
            "sensors 401 to 500",
        ]
        await parts.select_option("400")
        await expect(page.locator("#raster canvas")).to_have_attribute(
            "aria-label",
            "100 sensors over ticks 1 to 6. Arrows move, Enter goes there.",
        )
        assert await faults(page) == []
