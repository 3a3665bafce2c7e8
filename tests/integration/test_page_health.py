"""The health of sensors on the page, in a real browser."""

from pathlib import Path

from playwright.async_api import expect

from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.home_runs import FLUSH

pytestmark = IN_BROWSER


async def test_the_alarms_are_counted_on_the_tab_and_told_behind_it(
    home_log: Path,
) -> None:
    async with opened(home_log) as page:
        tab = page.locator("#tab-health")
        await expect(tab).to_have_text("Health: 1 alarm")
        await tab.click()
        home = page.locator("#health")
        await expect(home).to_contain_text("; 8 of 8 sensors known")
        await expect(home.locator(".alarm")).to_contain_text("flush: silent since ")
        rows = home.locator("tbody tr")
        await expect(rows).to_have_count(8)
        await expect(rows.nth(FLUSH)).to_contain_text("in alarm")
