"""The range of ticks one looks at, and the curves over time, in a real browser."""

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import Locator, Page, expect

from neurosnap.apps.viewer.api import COUNTED
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.time_series import TimeSeries
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import path_run, recorded
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

TICKS = 40
LONG = 2000
END = 8  # pixels of the strip before its first tick and behind its last


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of more ticks than a curve has points."""
    run = path_run(LONG, cells="inline")
    return recorded(run, tmp_path_factory.mktemp("long") / "long.mcap")


async def drag(page: Page, what: Locator, across: tuple[float, float]) -> None:
    """Drag over something, from one place in pixels to another."""
    box = await what.bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    await page.mouse.move(box["x"] + across[0], y)
    await page.mouse.down()
    await page.mouse.move(box["x"] + sum(across) / 2, y)
    await page.mouse.move(box["x"] + across[1], y)
    await page.mouse.up()


async def plotted(page: Page, curve: str) -> tuple[list[int], list[float | None]]:
    """Return the ticks and the values of a curve, as they are drawn."""
    ticks, values = await page.evaluate(
        """async (curve) => {
            const { page } = await import("/main.js");
            const [heads, ...rows] = page.plots.rows();
            const at = heads.indexOf(curve);
            return [0, at].map((column) => rows.map((row) => row[column]));
        }""",
        curve,
    )
    return ticks, values


async def chosen(page: Page, first: int, last: int) -> None:
    """Wait until a range is looked at, and the curves show it alone."""
    await expect(page.locator("#range")).to_have_text(f"↻ {first} to {last} ×")
    await drawn(page, first, last)


async def drawn(page: Page, first: int, last: int) -> None:
    """Wait until the curves show some ticks, and no other."""
    async with asyncio.timeout(PATIENCE):
        while (await plotted(page, "edges"))[0] != list(range(first, last + 1)):
            await page.evaluate("new Promise(requestAnimationFrame)")


async def test_dragging_over_the_strip_chooses_a_range(path_log: Path) -> None:
    async with opened(path_log, "#t=30") as page:
        await wait_shown(page, 30)
        strip = page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        a_tick = (box["width"] - 2 * END) / TICKS
        # From the middle of tick 5 to the middle of tick 12, backwards.
        await drag(page, strip, (END + 11.5 * a_tick, END + 4.5 * a_tick))
        await chosen(page, 5, 12)
        assert await page.locator("#time").input_value() == "30"
        band = page.locator("#strip .range")
        left = float(await band.get_attribute("x") or 0)
        width = float(await band.get_attribute("width") or 0)
        assert [left, width] == pytest.approx([END + 4 * a_tick, 8 * a_tick], abs=1)
        await page.click("#tab-raster")
        await expect(page.locator("#raster canvas")).to_have_attribute(
            "aria-label", "7 sensors over ticks 5 to 12. Arrows move, Enter goes there."
        )
        await page.wait_for_url("**/*range=5-12*")
        await page.click("#range")
        await expect(page.locator("#range")).to_be_hidden()
        await expect(page.locator("#raster canvas")).to_have_attribute(
            "aria-label", "7 sensors over ticks 1 to 40. Arrows move, Enter goes there."
        )
        await page.wait_for_url(lambda url: "range" not in url)


async def test_playing_repeats_the_range(path_log: Path) -> None:
    # The test hands out the screen's frames; the page takes them as its own.
    async with opened(path_log, "#t=30&range=5-8") as page:
        await wait_shown(page, 30)
        for tick in (5, 6, 7, 8):
            await go_to(page, tick)  # so that it is here
        await go_to(page, 30)
        shown = await page.evaluate(
            """async () => {
                const { page: { player } } = await import("/main.js");
                player.setSpeed(10);
                player.play();
                const ticks = [player.tick];
                for (let now = 0; now <= 1000; now += 100) {
                    player._advance(now);
                    ticks.push(player.tick);
                }
                const { playing } = player;
                player.pause();
                return [ticks, playing];
            }"""
        )
    assert shown == [[5, 5, 6, 7, 8, 5, 6, 7, 8, 5, 6, 7], True]


async def test_keys_choose_a_range_and_leave_it(path_log: Path) -> None:
    async with opened(path_log, "#t=10") as page:
        await wait_shown(page, 10)
        await page.keyboard.press("[")
        await chosen(page, 10, TICKS)
        await go_to(page, 20)
        await page.keyboard.press("]")
        await chosen(page, 10, 20)
        await go_to(page, 25)
        await page.keyboard.press("[")  # behind its end
        await chosen(page, 25, TICKS)
        await go_to(page, 3)
        await page.keyboard.press("]")
        await chosen(page, 1, 3)
        await page.keyboard.press("x")
        await expect(page.locator("#range")).to_be_hidden()


@pytest.mark.parametrize(
    ("link", "range_"), [("30-99", (30, 40)), ("7-7", (7, 7)), ("98-99", (40, 40))]
)
async def test_a_link_brings_a_range_as_far_as_there_is_one(
    path_log: Path, link: str, range_: tuple[int, int]
) -> None:
    async with opened(path_log, f"#t=9&range={link}") as page:
        await wait_shown(page, 9)
        text = f"↻ {link.replace('-', ' to ')} ×"
        await expect(page.locator("#range")).to_have_text(text)
        await drawn(page, *range_)


@pytest.mark.parametrize("link", ["9-5", "x", "1-", "-3"])
async def test_a_range_that_is_none_is_left_out(path_log: Path, link: str) -> None:
    async with opened(path_log, f"#t=9&range={link}") as page:
        await wait_shown(page, 9)
        await expect(page.locator("#range")).to_be_hidden()


async def test_dragging_over_a_curve_shows_each_of_its_ticks(long_log: Path) -> None:
    series = TimeSeries(RunView(long_log))
    while series.read_on():
        pass
    every = series.series("pulses", 1, LONG, LONG).values
    async with opened(long_log, "#t=1500") as page:
        await wait_shown(page, 1500)
        # Until all is read; of the last ticks one is drawn.
        while not any(tick > LONG - 10 for tick in (await plotted(page, "edges"))[0]):
            await page.evaluate("new Promise(requestAnimationFrame)")
        over = page.locator("#plots .u-over").first
        box = await over.bounding_box()
        assert box is not None
        at = (await plotted(page, "edges"))[0]
        assert len(at) < LONG  # thinned out
        await drag(page, over, (box["width"] * 0.5, box["width"] * 0.6))
        text = await page.locator("#range").inner_text()
        first, last = int(text.split()[1]), int(text.split()[3])
        assert first == pytest.approx(LONG * 0.5, abs=20)
        assert last == pytest.approx(LONG * 0.6, abs=20)
        await chosen(page, first, last)
        assert (await plotted(page, "pulses"))[1] == every[first - 1 : last]
        await wait_shown(page, 1500)  # a drag goes nowhere


async def test_what_is_under_the_pointer_is_told_in_all_plots(path_log: Path) -> None:
    view = RunView(path_log)
    async with opened(path_log, "#t=9") as page:
        await wait_shown(page, 9)
        await expect(page.locator("#plots .u-over")).to_have_count(5)
        over = page.locator("#plots .u-over").first
        box = await over.bounding_box()
        assert box is not None
        tick = 30
        x = box["width"] * (tick - 1) / (TICKS - 1)
        await over.hover(position={"x": x, "y": box["height"] / 2})
        at = page.locator("#plots-at")
        await expect(at).to_have_text(f"under the pointer: tick {tick}")
        (frame,) = view.frames(tick, tick)
        captions = page.locator("#plots figcaption")
        for k, told in enumerate(
            [
                f"Edges {frame.edges}",
                "Err ",
                f"Depth {frame.depth} Longest {frame.longest} Height {frame.height}",
                f"Pulses a tick {frame.pulses}",
                f"On {frame.state.count(1)} Predicted 0 Contradicted 0 Unknown 0",
            ]
        ):
            await expect(captions.nth(k)).to_contain_text(told)
        await page.mouse.move(1, 1)
        await expect(at).to_have_text("")
        (frame,) = view.frames(9, 9)
        await expect(captions.first).to_have_text(f"Edges {frame.edges}")


async def test_curves_that_are_not_wanted_go(path_log: Path) -> None:
    async with opened(path_log, "#t=9&hide=err") as page:
        await wait_shown(page, 9)
        figures = page.locator("#plots figure:visible")
        count = await figures.count()
        listed = page.locator("#curves label")
        await page.focus("#curves summary")
        await page.keyboard.press("Space")
        await expect(listed.first).to_be_visible()
        assert not await listed.filter(has_text="Err").locator("input").is_checked()
        for curve in ("Depth", "Longest"):
            await listed.filter(has_text=curve).locator("input").uncheck()
        await expect(figures).to_have_count(count)
        depth = page.locator("#plots figcaption").filter(has_text="Height")
        await expect(depth).not_to_contain_text("Depth", use_inner_text=True)
        await listed.filter(has_text="Height").locator("input").uncheck()
        await expect(figures).to_have_count(count - 1)
        await page.wait_for_url(
            lambda url: "hide=err%2Cdepth%2Clongest%2Cheight" in url
        )
        await listed.filter(has_text="Err").locator("input").check()
        await expect(figures).to_have_count(count)
        await page.keyboard.press("Escape")
        await expect(listed.first).to_be_hidden()
        await expect(page.locator("#curves summary")).to_be_focused()


async def test_the_counts_of_a_tick_are_those_of_its_curves(
    unread_log: Path, torn_log: Path, lamp_log: Path
) -> None:
    for log in (unread_log, torn_log, lamp_log):
        series = TimeSeries(RunView(log))
        while series.read_on():
            pass
        counted = [series.series(name, 1, 999, 1000).values for name in COUNTED]
        async with opened(log, "#t=1") as page:
            told = await page.evaluate(
                """async (names) => {
                    const { countAll } = await import("/tick/belief.js");
                    const { fetchFrames, fetchRun } = await import("/base/api.js");
                    const frames = await fetchFrames(1, (await fetchRun()).ticks);
                    const counts = frames.map(countAll);
                    return names.map((name) => counts.map((count) => count[name]));
                }""",
                COUNTED,
            )
        assert told == counted
        assert log != torn_log or counted[2][-1] == 3


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_axe_finds_nothing_in_ranges_and_curves(
    path_log: Path, scheme: Scheme
) -> None:
    async with opened(path_log, "#t=9&range=5-12", scheme) as page:
        await wait_shown(page, 9)
        await page.click("#curves summary")
        assert await faults(page) == []
