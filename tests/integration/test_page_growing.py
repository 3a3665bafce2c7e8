"""Births, imagined waves and plans on the page, in a real browser."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer import imagined
from neurosnap.apps.viewer.run_view import RunView
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.lamp import BIRTH, GROWN
from tools.browser import wait_shown

pytestmark = IN_BROWSER

TICKS = 60
PLANNED = 36  # a plan of two steps begins, and nothing gets in its way


async def test_a_sensor_is_drawn_and_listed_from_its_birth_on(lamp_log: Path) -> None:
    async with opened(lamp_log, f"#t={BIRTH - 1}") as page:
        await wait_shown(page, BIRTH - 1)
        facts = page.locator("#diagram-facts")
        await expect(facts).to_contain_text("24 sensors,")
        await expect(page.locator("#what")).to_contain_text(
            "24 sensors, 1 grown, room for 2 more"
        )
        await page.click("#tab-sensors")
        rows = page.locator("#outline tbody tr:visible")
        await expect(rows).to_have_count(24)
        await go_to(page, BIRTH)
        await expect(facts).to_contain_text("25 sensors,")
        await expect(rows).to_have_count(25)
        await expect(rows.last.locator("th")).to_have_text(GROWN)
        await expect(rows.last.locator(".born")).to_have_text(f"tick {BIRTH}")
        await expect(page.locator("#now")).to_contain_text(f"grew {GROWN}")
        await expect(page.locator("#said")).to_contain_text(f"grew {GROWN}")
        await rows.last.locator("button").click()
        await expect(page.locator("#choice-title")).to_have_text(GROWN)
        await expect(page.locator("#choice-body")).to_contain_text(
            f"tick {BIRTH}, learned from {BIRTH} ticks"
        )
        await go_to(page, 5)
        await expect(page.locator("#choice-body")).to_contain_text("not grown yet")
        for text, found in (("grown", "none"), (GROWN, "1 found")):
            await page.fill("#search-text", text)
            await expect(page.locator("#search-found")).to_have_text(found)


async def test_one_goes_from_birth_to_birth_by_the_keyboard(lamp_log: Path) -> None:
    async with opened(lamp_log, "#t=3") as page:
        await wait_shown(page, 3)
        mark = page.locator("#strip .born")
        await expect(mark).to_have_count(1)
        line, at = await page.locator("#time").bounding_box(), await mark.bounding_box()
        assert line is not None
        assert at is not None
        share = (at["x"] + at["width"] / 2 - line["x"] - 8) / (line["width"] - 16)
        assert share == pytest.approx((BIRTH - 0.5) / TICKS, abs=0.01)
        await page.keyboard.press("b")
        await wait_shown(page, BIRTH)
        await go_to(page, TICKS)
        await page.keyboard.press("Shift+B")
        await wait_shown(page, BIRTH)
        await go_to(page, TICKS)
        await page.focus("#birth-back")
        await page.keyboard.press("Enter")
        await wait_shown(page, BIRTH)
        await go_to(page, TICKS)
        await page.focus("#tab-plots")
        for tab in ("raster", "sensors", "grown"):
            await page.keyboard.press("ArrowRight")
            await expect(page.locator(f"#tab-{tab}")).to_be_focused()
        row = page.locator("#grown-list tbody tr")
        await expect(row).to_contain_text(f"{BIRTH} ticks")
        await row.locator("td button").focus()
        await page.keyboard.press("Enter")
        await wait_shown(page, BIRTH)
        await row.locator("th button").focus()
        await page.keyboard.press("Enter")
        await expect(page.locator("#choice-title")).to_have_text(GROWN)


async def test_an_imagined_wave_is_told_apart_and_the_plan_is_shown(
    lamp_log: Path,
) -> None:
    async with opened(lamp_log, f"#t={PLANNED}", still=True) as page:
        await wait_shown(page, PLANNED)
        which = page.locator("#wave-which")
        here = await which.locator("> option").all_inner_texts()
        assert here == [
            "state",
            *(f"consequences of {action}" for action in ("turn_a", "turn_b", "press")),
        ]
        ahead = await which.locator("optgroup option").all_inner_texts()
        assert "imagined, 2 steps ahead: turn_a, press" in ahead
        label = page.locator("#drawing-wave")
        await expect(label).to_be_hidden()
        await page.click("#wave-play")
        await expect(label).to_have_text("state")
        await which.select_option("turn_a, press")
        await expect(label).to_have_text("imagined, 2 steps ahead: turn_a, press")
        await expect(label).to_have_class("imagined")
        await expect(page.locator("#wave-says")).to_contain_text(
            "Imagined, 2 steps ahead: turn_a, press. Hop"
        )
        steps = page.locator(".plan li")
        await expect(steps).to_have_text(["turn_a", "turn_b"])
        await expect(steps.first).to_have_attribute("aria-current", "step")
        await expect(page.locator(".plan")).to_have_attribute(
            "aria-label", "Plan: step 1 of 2"
        )
        await go_to(page, PLANNED + 1)
        await expect(steps.nth(1)).to_have_attribute("aria-current", "step")
        await expect(steps.first).to_have_class("done")


async def test_of_many_imagined_waves_some_are_shown_and_the_others_counted(
    lamp_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (whole,) = RunView(lamp_log).frames(PLANNED, PLANNED)
    count = sum(wave.imagined for wave in whole.waves)
    monkeypatch.setattr(imagined, "MOST_IMAGINED", 2)
    async with opened(lamp_log, f"#t={PLANNED}") as page:
        await wait_shown(page, PLANNED)
        options = page.locator("#wave-which optgroup option")
        said = await options.all_inner_texts()
        assert len(said) == 3
        assert "imagined, 2 steps ahead: turn_a, turn_b" in said  # the plan's
        assert said[-1] == f"and {count - 2} more, not shown"
        await expect(options.last).to_be_disabled()


async def test_a_page_of_a_run_that_grows_nothing_has_none_of_it(
    path_log: Path,
) -> None:
    async with opened(path_log, "#t=3") as page:
        await wait_shown(page, 3)
        for what in ("#tab-grown", "#grown", ".plan", "#tab-health", "#health"):
            await expect(page.locator(what)).to_have_count(0)
        for what in ("#birth-on", "#birth-back"):
            await expect(page.locator(what)).to_be_hidden()
        await expect(page.locator("#now")).not_to_contain_text("grown")
