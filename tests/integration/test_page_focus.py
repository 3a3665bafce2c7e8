"""The part of the order that the page of `neurosnap view` looks at.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.support.browser_pages import IN_BROWSER, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import TICKS, told
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

SEEN = """async () => {
    const { page } = await import("/main.js");
    const { sensors } = page.diagram._focus;
    return sensors && [...sensors].sort((a, b) => a - b);
}"""
LAID = """async () => {
    const { page } = await import("/main.js");
    const items = page.diagram._drawing.items;
    return items.flatMap(({ sensors }) => sensors).sort((a, b) => a - b);
}"""


def related(log: Path, tick: int, sensor: int) -> list[int]:
    """Return the sensors that have a literal above or below one of a sensor's."""
    hasse = told(log)[tick].hasse
    reached, ahead = {2 * sensor, 2 * sensor + 1}, [2 * sensor, 2 * sensor + 1]
    while ahead:
        one = ahead.pop()
        found = {b for a, b in hasse if a == one} - reached
        reached |= found
        ahead += found
    return sorted({literal >> 1 for literal in reached})


async def pick(page: Page, sensor: int) -> None:
    await page.click("#tab-sensors")
    await page.locator("#outline tbody button").nth(sensor).click()


async def test_a_selected_sensor_leaves_clear_what_is_above_and_below_it(
    planner_log: Path,
) -> None:
    sensor = 3
    truth = related(planner_log, TICKS, sensor)
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        assert await page.evaluate(SEEN) is None
        await expect(page.locator("#focus-depth")).to_be_disabled()
        await pick(page, sensor)
        assert await page.evaluate(SEEN) == truth
        await page.select_option("#focus-depth", "1")
        near = await page.evaluate(SEEN)
        await page.select_option("#focus-depth", "2")
        farther = await page.evaluate(SEEN)
        assert sensor in near
        assert set(near) < set(farther) <= set(truth) < set(range(40))
        dim = await page.evaluate(
            """async () => {
                const { page: { diagram, frame } } = await import("/main.js");
                const { looks } = await import("/order/looks.js");
                const look = looks(frame, null, null, null, diagram._focus.sensors);
                return diagram._drawing.items
                    .filter((item) => look(item).dim).flatMap(({ sensors }) => sensors);
            }"""
        )
        assert set(dim) == set(range(40)) - set(farther)
        await page.keyboard.press("Escape")
        assert await page.evaluate(SEEN) is None


async def test_what_is_looked_at_is_laid_out_alone(planner_log: Path) -> None:
    sensor = 3
    truth = related(planner_log, TICKS, sensor)
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        place = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                return diagram._camera.over(diagram._laid.places.get("s3"));
            }"""
        )
        box = await page.locator("#drawing").bounding_box()
        assert box is not None
        await page.mouse.dblclick(box["x"] + place["x"], box["y"] + place["y"])
        assert await page.evaluate(LAID) == truth
        shown = f"{len(truth)} of them shown"
        await expect(page.locator("#diagram-facts")).to_contain_text(shown)
        await page.press("body", "f")
        assert await page.evaluate(LAID) == list(range(40))
        await page.press("body", "f")
        assert await page.evaluate(LAID) == truth
        await page.keyboard.press("Escape")
        assert await page.evaluate(LAID) == list(range(40))


async def test_edges_are_left_out_by_kind(planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        kinds = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                return page.diagram._drawing.links.flatMap(({ kind, edges }) =>
                    edges.map(() => kind));
            }"""
        )
        chip = page.locator("#focus-edges button")
        await expect(chip.nth(0)).to_have_text(f"excites {kinds.count('excite')}")
        await expect(chip.nth(1)).to_have_text(f"inhibits {kinds.count('inhibit')}")
        await pick(page, 3)
        whole = await page.evaluate(SEEN)
        await chip.nth(0).focus()
        await page.keyboard.press("Enter")
        await expect(chip.nth(0)).to_have_attribute("aria-pressed", "false")
        fewer = await page.evaluate(SEEN)
        assert set(fewer) < set(whole)


async def test_only_what_is_predicted_or_contradicted_is_kept(
    unread_log: Path,
) -> None:
    async with opened(unread_log, "#t=31") as page:
        await wait_shown(page, 31)
        chip = page.locator("#focus-only button")
        words = ["on 2", "contradicted 0", "predicted 1", "grown 0"]
        assert await chip.all_inner_texts() == words
        await chip.nth(2).click()
        assert await page.evaluate(SEEN) == [1]
        await page.click("#focus-alone")
        assert await page.evaluate(LAID) == [1]
        await chip.nth(2).click()
        await chip.nth(1).click()
        await page.press("body", "ArrowRight")
        await wait_shown(page, 32)
        assert await page.evaluate(LAID) == [0, 1]  # each says the other is wrong


async def test_five_hundred_sensors_are_looked_at_in_part(large_log: Path) -> None:
    sensor = 210
    truth = related(large_log, 6, sensor)
    async with opened(large_log, "#t=6") as page:
        await wait_shown(page, 6)
        await pick(page, sensor)
        await page.press("body", "f")
        assert await page.evaluate(LAID) == truth
        assert len(truth) < 500


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_axe_finds_no_fault_in_what_is_looked_at(
    scheme: Scheme, planner_log: Path
) -> None:
    async with opened(planner_log, f"#t={TICKS}", scheme) as page:
        await wait_shown(page, TICKS)
        assert await faults(page) == []
        await pick(page, 3)
        await page.press("body", "f")
        assert await faults(page) == []
