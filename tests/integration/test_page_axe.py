"""The page is for every eye and every screen: axe over all of its states.

The states are those that the documentation shows, and some that no picture has.
"""

import re
from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tests.support.browser_pages import IN_BROWSER, looked_at, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import TICKS
from tools.browser import SIZE, Scheme, wait_shown
from tools.screenshots.recordings import recorded
from tools.screenshots.states import STATES, enter

pytestmark = IN_BROWSER

DOCS = Path(__file__).parents[2] / "docs"
PHONE = 360, 740
CONTROLS = ("#search", "#help", "#fit", "#wave-play", "#taller", "#speed", "#world svg")
COLOURED = ("wave", "belief", "raster", "compare")
"""States that have all colours between them."""
schemes = pytest.mark.parametrize("scheme", ["light", "dark"])


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recordings")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scheme"),
    [*((name, "light") for name in STATES), *((name, "dark") for name in COLOURED)],
)
async def test_each_state_can_be_entered_and_axe_finds_nothing_in_it(
    name: str, scheme: Scheme, recordings: Path
) -> None:
    state = STATES[name]
    logs = [recorded(each, recordings) for each in state.recordings]
    async with (
        serving(*map(ViewSession, logs)) as address,
        looked_at(address.url, scheme, still=True) as page,
    ):
        await enter(page, state, address.url)
        assert await faults(page) == []
        # No picture tells of this machine.
        assert str(recordings) not in await page.inner_text("body")


async def test_the_documentation_shows_each_of_them() -> None:
    texts = [page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")]
    shown = {name for text in texts for name in re.findall(r"view-(\w+)\.png", text)}
    assert shown == set(STATES)
    for name in STATES:
        assert (DOCS / f"view-{name}.png").is_file()


@schemes
async def test_axe_finds_nothing_in_tables_a_selection_and_an_edge(
    planner_log: Path, scheme: Scheme
) -> None:
    async with opened(planner_log, f"#t={TICKS}&range=5-12", scheme) as page:
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").first.click()
        await page.locator("#choice button.link").first.click()
        await page.wait_for_selector("#choice .uplot canvas")
        await page.locator("#now .term", has_text="height").hover()
        await expect(page.locator("#tip")).to_be_visible()
        assert await faults(page) == []


@pytest.mark.slow
@schemes
async def test_axe_finds_nothing_where_something_is_broken(
    home_log: Path, unread_log: Path, scheme: Scheme
) -> None:
    async with opened(unread_log, "#t=32&tab=sensors", scheme) as page:
        assert await faults(page) == []
    async with opened(home_log, "#t=1&tab=health", scheme) as page:
        await expect(page.locator("#strip .alarm")).not_to_have_count(0)
        await page.keyboard.press("n")
        await expect(page.locator(".card:visible")).not_to_have_count(0)
        assert await faults(page) == []


@pytest.mark.slow
@pytest.mark.parametrize("size", [SIZE, PHONE])
async def test_it_fits_a_small_screen(planner_log: Path, size: tuple[int, int]) -> None:
    width, height = size
    async with opened(planner_log, f"#t={TICKS}") as page:
        await page.set_viewport_size({"width": width, "height": height})
        await wait_shown(page, TICKS)
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
            box = await page.locator("#diagram").bounding_box()
            assert box is not None
            assert 0.5 * height < box["height"] < 0.6 * height
            return
        for part in CONTROLS:
            box = await page.locator(part).bounding_box()
            assert box is not None
            assert min(box["x"], box["y"]) >= 0
            assert box["x"] + box["width"] <= width
            assert box["y"] + box["height"] <= height
