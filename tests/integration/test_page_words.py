"""What the page of `neurosnap view` explains by itself.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import TICKS
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER


async def test_a_state_wave_that_goes_nowhere_says_why_and_offers_another(
    planner_log: Path,
) -> None:
    async with opened(planner_log, f"#t={TICKS - 1}") as page:
        await wait_shown(page, TICKS - 1)
        depths = await page.evaluate(
            """async () => (await import("/main.js")).page.frame.waves
                .filter(({ imagined }) => !imagined).map(({ depth }) => depth)"""
        )
        why = "All 40 sensors were read: nothing to infer."
        await expect(page.locator("#wave-why")).to_have_text(why)
        deepest = max(depths)
        assert deepest > 2
        await expect(page.locator("#wave-deepest")).to_contain_text(f"{deepest} hops")
        await page.press("#wave-deepest", "Enter")
        assert await page.get_attribute("#wave-hop", "max") == str(deepest)
        await expect(page.locator("#wave-why")).to_be_hidden()
        await expect(page.locator("#wave-which")).to_be_focused()


async def test_a_wave_with_depth_needs_no_excuse(unread_log: Path) -> None:
    async with opened(unread_log, "#t=31") as page:
        await wait_shown(page, 31)
        assert await page.get_attribute("#wave-hop", "max") == "1"
        await expect(page.locator("#wave-why")).to_be_hidden()


async def test_edges_are_listed_by_what_they_say(planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        sensor, count = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const counts = new Map();
                for (const { source, target } of page.graph.edges) {
                    for (const one of [source >> 1, target >> 1]) {
                        counts.set(one, (counts.get(one) ?? 0) + 1);
                    }
                }
                return [...counts].reduce((a, b) => (b[1] > a[1] ? b : a));
            }"""
        )
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").nth(sensor).click()
        titles = await page.locator("#choice h3").all_inner_texts()
        counts = [int(title.rpartition(" ")[2]) for title in titles]
        assert sum(counts) == count
        known = ("implies", "implied by", "excludes", "one of the two is on")
        assert {title.rpartition(" ")[0] for title in titles} <= set(known)
        for more in await page.locator("#choice button", has_text="Show all").all():
            await more.click()
        assert await page.locator("#choice .edges button").count() == count


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_axe_finds_no_fault_in_what_is_explained(
    scheme: Scheme, planner_log: Path
) -> None:
    async with opened(planner_log, f"#t={TICKS - 1}", scheme) as page:
        await wait_shown(page, TICKS - 1)
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").nth(3).click()
        await expect(page.locator("#choice h3").first).to_be_visible()
        assert await faults(page) == []
