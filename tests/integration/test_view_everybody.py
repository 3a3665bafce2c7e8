"""The page of `neurosnap view` is for every eye and every screen.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

from pathlib import Path

import pytest

from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import TICKS
from tools.browser import SIZE, Scheme, wait_shown

pytestmark = IN_BROWSER

CONTROLS = ("#search", "#help", "#fit", "#wave-play", "#taller", "#speed")
schemes = pytest.mark.parametrize("scheme", ["light", "dark"])


@schemes
async def test_axe_finds_no_serious_fault(scheme: Scheme, planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}", scheme) as page:
        await wait_shown(page, TICKS)
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").first.click()
        await page.locator("#choice button.link").first.click()
        await page.wait_for_selector("#choice .uplot canvas")
        for tab in ("sensors", "cells", "plots"):
            await page.click(f"#tab-{tab}")
            await page.wait_for_selector(f"#{tab}:not(:empty)")
            assert await faults(page) == []


async def test_it_fits_a_small_screen(planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        size = await page.evaluate(
            """() => {
                const { scrollWidth, scrollHeight } = document.documentElement;
                return [scrollWidth, scrollHeight];
            }"""
        )
        assert tuple(size) == SIZE
        for part in (*CONTROLS, "#world svg"):
            box = await page.locator(part).bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["y"] >= 0
            assert box["x"] + box["width"] <= SIZE[0]
            assert box["y"] + box["height"] <= SIZE[1]
