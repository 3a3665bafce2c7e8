"""The page is accessible in all its states (checked with axe).

The states are those that the documentation shows, and some that no picture has.
"""

import re
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, expect

from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.server import serving
from tests.support.browser_pages import IN_BROWSER, looked_at, opened, page_at
from tests.support.exhaustive import rows
from tests.support.recorded_runs import TICKS
from tools.browser import SIZE, Scheme, wait_shown
from tools.screenshots.recordings import recorded
from tools.screenshots.states import STATES, enter

pytestmark = IN_BROWSER
DOCS = Path(__file__).parents[2] / "docs"
AXE = Path(__file__).parents[1] / "vendor" / "axe-core" / "axe.min.js"
PLANNED = 36  # ticks of the lamp, at which a plan of two steps begins
PHONE = 360, 740
SCHEMES: tuple[Scheme, ...] = ("dark", "light")
CONTROLS = ("#search", "#help", "#fit", "#wave-play", "#taller", "#speed", "#world svg")
ENTERED = ("belief", "wave", "time", "compare", "raster", "phone")
"""States that have between them all that the others show; their runs are short."""


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recordings")


async def faults(page: Page) -> list[object]:
    """Return the serious and critical ones, with the elements they are found in."""
    if not await page.evaluate("() => 'axe' in window"):
        await page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[object] = await page.evaluate(
        """async () => (await axe.run()).violations
            .filter(({ impact }) => impact === "serious" || impact === "critical")
            .map(({ id, nodes }) => [id, nodes.map(({ html }) => html)])"""
    )
    return found


async def no_fault_in_either_scheme(page: Page) -> None:
    for scheme in SCHEMES:
        await page.emulate_media(color_scheme=scheme)
        assert await faults(page) == [], scheme


@pytest.mark.slow
@pytest.mark.parametrize("name", rows(ENTERED[:1], ENTERED[1:]))
async def test_each_state_can_be_entered_and_axe_finds_nothing_in_it(
    name: str, recordings: Path
) -> None:
    state = STATES[name]
    logs = [recorded(each, recordings) for each in state.recordings]
    async with (
        serving(*map(ViewSession, logs)) as address,
        looked_at(address.url, still=True) as page,
    ):
        await enter(page, state, address.url)
        await no_fault_in_either_scheme(page)
        # No picture tells of this machine.
        assert str(recordings) not in await page.inner_text("body")


async def test_the_documentation_shows_each_of_them() -> None:
    texts = [page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")]
    shown = {name for text in texts for name in re.findall(r"view-(\w+)\.png", text)}
    assert shown == set(STATES)
    for name in STATES:
        assert (DOCS / f"view-{name}.png").is_file()


@pytest.mark.slow
async def test_axe_finds_nothing_in_what_no_picture_shows(
    planner_log: Path, unread_log: Path, home_log: Path, lamp_log: Path
) -> None:
    page = await page_at(planner_log, TICKS)
    await page.click("#tab-sensors")
    await page.locator("#outline tbody button").first.click()
    await page.locator("#choice button.link").first.click()
    await page.wait_for_selector("#choice-body[data-tick]")
    await page.locator("#now .term", has_text="height").hover()
    await expect(page.locator("#tip")).to_be_visible()
    await no_fault_in_either_scheme(page)
    page = await page_at(unread_log, 32)
    await page.click("#tab-sensors")
    await no_fault_in_either_scheme(page)
    page = await page_at(home_log, 1)
    await page.click("#tab-findings")
    await expect(page.locator("#findings tbody tr")).not_to_have_count(0)
    await page.keyboard.press("n")
    await expect(page.locator(".card:visible")).not_to_have_count(0)
    await no_fault_in_either_scheme(page)
    page = await page_at(lamp_log, PLANNED)
    await page.click("#tab-grown")
    await expect(page.locator(".plan li")).to_have_count(2)
    await no_fault_in_either_scheme(page)


@pytest.mark.slow
async def test_six_tabs_stand_side_by_side_on_a_phone(lamp_log: Path) -> None:
    async with opened(lamp_log, "#t=1") as page:
        await page.set_viewport_size({"width": 390, "height": 844})
        await page.wait_for_function("innerWidth === 390")
        right, *tabs = await page.evaluate(
            """async () => {
                await new Promise(requestAnimationFrame); // laid out for that width
                return [...document.querySelectorAll("[role=tablist], [role=tab]")]
                    .map((one) => one.getBoundingClientRect())
                    .map(({ top, right }) => [top, right]);
            }"""
        )
        assert len(tabs) == 6
        assert len({top for top, _ in tabs}) == 1
        assert max(end for _, end in tabs) <= right[1] + 0.5 < 390


@pytest.mark.slow
async def test_what_is_off_and_what_is_predicted_off_can_be_told_apart(
    path_log: Path,
) -> None:
    page = await page_at(path_log, 1)
    for scheme in SCHEMES:
        await page.emulate_media(color_scheme=scheme)
        inks = await page.evaluate(
            r"""async () => {
                const { palette } = await import("/base/dom.js");
                const { panel, guess } = palette();
                return [panel, guess].map((ink) => ink.match(/[\d.]+/g).map(Number));
            }"""
        )
        dark, light = sorted(luminance(ink) for ink in inks)
        assert (light + 0.05) / (dark + 0.05) >= 3, scheme


def luminance(ink: list[float]) -> float:
    """Return the relative luminance of a colour, as WCAG 2.2 has it."""
    parts = [part / 255 for part in ink[:3]]
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in parts
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.slow
@pytest.mark.parametrize("size", [SIZE, PHONE])
async def test_it_fits_a_small_screen(planner_log: Path, size: tuple[int, int]) -> None:
    width, height = size
    async with opened(planner_log, f"#t={TICKS}") as page:
        await page.set_viewport_size({"width": width, "height": height})
        await wait_shown(page, TICKS)
        long = "document.querySelector('#what').textContent = 'a path '.repeat(99)"
        await page.evaluate(long)
        for tab in ("plots", "sensors", "compare"):
            await page.click(f"#tab-{tab}")
            await page.wait_for_selector(f"#{tab}:not(:empty)")
            wide = await page.evaluate(
                """[...document.querySelectorAll("body, header, main, footer, main > *")]
                    .map((one) => one.scrollWidth)"""
            )
            assert max(wide) <= width
            assert await faults(page) == []
        if size == PHONE:
            box: Any = await page.locator("#diagram").bounding_box()
            assert 0.5 * height < box["height"] < 0.6 * height
            await page.click("#wave-play")  # it brings the diagram back into sight
            await expect(page.locator("#diagram")).to_be_in_viewport(ratio=0.99)
            return
        for part in CONTROLS:
            box = await page.locator(part).bounding_box()
            assert min(box["x"], box["y"]) >= 0
            assert box["x"] + box["width"] <= width
            assert box["y"] + box["height"] <= height
