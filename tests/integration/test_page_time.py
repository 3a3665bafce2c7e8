"""Moving through a recording on the page, and what is shown over time."""

import asyncio
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Locator, Page, expect

from neurosnap.apps.viewer.api import COUNTED
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from tests.support.browser_pages import (
    IN_BROWSER,
    go_to,
    opened,
    page_at,
    shown_tick,
    states,
    worded,
)
from tests.support.lamp import BIRTH
from tests.support.page_requests import read
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, path_run, recorded, without_states
from tools.browser import wait_shown, wait_until

pytestmark = IN_BROWSER
LONG = 2000
END = 8  # pixels of the strip before its first tick and behind its last
NAMES, HIGH = 170, 13  # pixels: the column of names, and a row
READ = 31  # ticks, of which the last has a sensor that is predicted
RESIZED = """async (width) => {
    const { page: { time: { raster } } } = await import("/main.js");
    raster._map.style.width = width;
    raster.mark(raster._findings);  // which draws what is there
}"""
MARKED = 60  # ticks of the run in which a rule is broken


async def test_playing_goes_on_and_stops_at_the_end(path_log: Path) -> None:
    truth = worded(path_log)
    page = await page_at(path_log, 20)
    await page.click("#tab-sensors")
    play = page.locator("#play")
    await page.select_option("#speed", "5")
    await play.click()
    await expect(play).to_have_attribute("aria-label", "Pause")
    await wait_until(page, "document.querySelector('#drawing').dataset.tick > 25")
    await play.click()
    await expect(play).to_have_attribute("aria-label", "Play")
    tick = await shown_tick(page)
    await wait_shown(page, tick)
    assert await states(page, tick) == truth[tick]
    await page.click("#on")
    await wait_shown(page, tick + 1)
    await page.click("#back")
    await wait_shown(page, tick)
    await page.select_option("#speed", "20")
    await play.click()
    await wait_shown(page, TICKS)
    await expect(play).to_have_attribute("aria-label", "Play")
    await page.click("#start")
    await wait_shown(page, 1)
    await page.evaluate("location.hash = 't=9'")
    await wait_shown(page, 9)


async def test_the_last_tick_is_shown_however_late_the_frames_come(
    path_log: Path,
) -> None:
    async with opened(path_log, "#t=1") as page:
        await page.evaluate(
            """() => {
                const real = requestAnimationFrame;
                window.requestAnimationFrame = (then) => real((now) => then(now * 1000));
            }"""
        )
        await page.select_option("#speed", "20")  # five ticks a frame
        await page.click("#play")
        await expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
        await wait_shown(page, TICKS)


async def test_everything_goes_by_keyboard(path_log: Path) -> None:
    page = await page_at(path_log, 1)
    keys = page.keyboard
    steps = [
        ("End", TICKS),
        ("ArrowLeft", TICKS - 1),
        ("Shift+ArrowLeft", TICKS - 11),
        ("ArrowRight", TICKS - 10),
        ("Shift+ArrowRight", TICKS),
        ("Home", 1),
    ]
    for key, tick in steps:
        await keys.press(key)
        await wait_shown(page, tick)
    await page.focus("#time")
    await keys.press("ArrowRight")  # our step, and not one more of the slider's own
    await wait_shown(page, 2)
    label = await page.get_attribute("#time", "aria-valuetext")
    assert label == f"tick 2 of {TICKS}"
    await page.evaluate("document.activeElement.blur()")
    await keys.press("Space")
    await expect(page.locator("#play")).to_have_attribute("aria-label", "Pause")
    await keys.press("Space")
    await expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
    await keys.press("?")
    await expect(page.locator("dialog#keys")).to_be_visible()
    await keys.press("Escape")
    await expect(page.locator("dialog#keys")).to_be_hidden()
    await keys.press("t")
    await expect(page.locator("#taller")).to_have_attribute("aria-pressed", "true")
    await page.focus("#tab-raster")
    await keys.press("ArrowRight")
    await expect(page.locator("#sensors")).to_be_visible()
    words = await page.locator("#outline thead .term").count()
    assert words == 5
    buttons = await page.locator("#dock > .bar .buttons button:visible").count()
    for _ in range(buttons + 1 + words + 1):  # past the panel, too
        await keys.press("Tab")
    await keys.press("Enter")  # the first sensor of the table
    await expect(page.locator("#choice-title")).to_have_text("below_1")


@pytest.mark.slow
async def test_a_tick_is_said_to_whoever_cannot_see_it(csv_log: Path) -> None:
    truth = worded(csv_log)
    async with opened(csv_log, "#t=24") as page:
        # A screen reader is told by this alone.
        loud = 'output, [aria-live], [role="status"]'
        assert await page.locator("footer").locator(loud).count() == 0
        said = page.locator("#said")
        await expect(said).to_have_text("tick 24")
        await page.press("body", "ArrowRight")
        changed = [
            f"{name} {now}"
            for name, was, now in zip("abc", truth[24], truth[25], strict=True)
            if was != now
        ]
        assert changed
        await expect(said).to_have_text(f"tick 25: {', '.join(changed)}")


@pytest.mark.slow
async def test_a_sensor_is_found_by_a_part_of_its_name(planner_log: Path) -> None:
    page = await page_at(planner_log, 1)
    await page.keyboard.press("/")
    await page.keyboard.type("X_below_2")
    found = page.locator("#search-found")
    names = Recording.open(planner_log).options.sensors
    count = sum("x_below_2" in name for name in names)
    await expect(found).to_have_text(f"{count} found")
    await page.keyboard.press("Enter")
    await expect(page.locator("#choice-title")).to_have_text("x_below_2")
    await page.keyboard.press("Enter")
    title = page.locator("#choice-title")
    await expect(title).not_to_have_text("x_below_2")
    await expect(title).to_contain_text("x_below_2")
    await page.keyboard.press("Control+a")
    await page.keyboard.type("nothing")
    await expect(found).to_have_text("none")
    await page.keyboard.press("Escape")
    await expect(found).to_have_text("")


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of more ticks than a curve has points."""
    run = path_run(LONG, cells="inline")
    return recorded(run, tmp_path_factory.mktemp("long") / "long.mcap")


async def drag(page: Page, what: Locator, across: tuple[float, float]) -> None:
    """Drag over something, from one place in pixels to another."""
    box: Any = await what.bounding_box()
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
            for (const { columns, chart } of page.time.plots._plots) {
                const at = columns.indexOf(curve);
                if (at >= 0) return chart._data ? [chart._data[0], chart._data[at + 1]] : [[], []];
            }
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


@pytest.mark.slow
async def test_a_range_is_shown_alone(path_log: Path) -> None:
    page = await page_at(path_log, 5)
    await page.keyboard.press("[")
    await go_to(page, 12)
    await page.keyboard.press("]")
    await chosen(page, 5, 12)
    box: Any = await page.locator("#strip").bounding_box()
    a_tick = (box["width"] - 2 * END) / TICKS
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


@pytest.mark.slow
async def test_playing_repeats_the_range(path_log: Path) -> None:
    # The test hands out the screen's frames; the page takes them as its own.
    async with opened(path_log, "#t=30&range=5-8") as page:
        for tick in (5, 6, 7, 8):
            await go_to(page, tick)  # so that it is here
        await go_to(page, 30)
        shown = await page.evaluate(
            """async () => {
                const { page: { time: { player } } } = await import("/main.js");
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


@pytest.mark.slow
async def test_keys_choose_a_range_and_leave_it(path_log: Path) -> None:
    page = await page_at(path_log, 10)
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


@pytest.mark.slow
async def test_a_link_brings_a_range_as_far_as_there_is_one(path_log: Path) -> None:
    links = {"30-99": (30, 40), "7-7": (7, 7), "98-99": (40, 40)}
    page = await page_at(path_log, 9)
    for link, range_ in links.items():
        await page.evaluate("(link) => { location.hash = link; }", f"range={link}")
        text = f"↻ {link.replace('-', ' to ')} ×"
        await expect(page.locator("#range")).to_have_text(text)
        await drawn(page, *range_)


@pytest.mark.slow
async def test_dragging_over_a_curve_shows_each_of_its_ticks(long_log: Path) -> None:
    every = read(long_log).series(1, LONG, LONG).columns["pulses"].values
    async with opened(long_log, "#t=1500") as page:
        # Until all is read; of the last ticks one is drawn.
        while not any(tick > LONG - 10 for tick in (await plotted(page, "edges"))[0]):
            await page.evaluate("new Promise(requestAnimationFrame)")
        over = page.locator("#plots .u-over").first
        box: Any = await over.bounding_box()
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


@pytest.mark.slow
async def test_what_is_under_the_pointer_is_told_in_all_plots(path_log: Path) -> None:
    view = RunView(path_log)
    page = await page_at(path_log, 9)
    await expect(page.locator("#plots .u-over")).to_have_count(4)
    over = page.locator("#plots .u-over").first
    box: Any = await over.bounding_box()
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


@pytest.mark.slow
async def test_the_counts_of_a_tick_are_those_of_its_curves(
    unread_log: Path, torn_log: Path, lamp_log: Path
) -> None:
    for log in (unread_log, torn_log, lamp_log):
        columns = read(log).series(1, 999, 1000).columns
        counted = [columns[name].values for name in COUNTED]
        async with opened(log, "#t=1") as page:
            told = await page.evaluate(
                """async (names) => {
                    const { countAll } = await import("/tick/belief.js");
                    const { ask } = await import("/base/api.js");
                    const to = (await ask("run")).ticks;
                    const { frames } = await ask("frames", { from: 1, to });
                    const counts = frames.map(countAll);
                    return names.map((name) => counts.map((count) => count[name]));
                }""",
                COUNTED,
            )
        assert told == counted
        assert log != torn_log or counted[2][-1] == 3


@pytest.mark.slow
async def test_the_pointer_tells_each_value_and_a_click_goes_there(
    unread_log: Path,
) -> None:
    view = RunView(unread_log)
    names = view.options.sensors
    page = await page_at(unread_log, 2)
    await page.click("#tab-raster")
    await page.wait_for_selector("#raster canvas[aria-label*=over]")
    canvas = page.locator("#raster canvas")
    for width, to in [("190px", "31, one of 2 ticks"), ("", view.last)]:
        await page.evaluate(RESIZED, width)
        label = f"3 sensors over ticks 1 to {to}. Arrows move, Enter goes there."
        await expect(canvas).to_have_attribute("aria-label", label)
    box: Any = await canvas.bounding_box()
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
    await page.focus("#raster canvas")
    await page.keyboard.press("ArrowDown")
    await page.keyboard.press("ArrowLeft")
    await expect(says).to_contain_text(f"{names[2]}, tick {READ - 1}: ")
    await page.keyboard.press("Enter")
    await wait_shown(page, READ - 1)
    assert await page.inner_text("#choice-title") == names[2]


async def test_n_and_p_go_from_anomaly_to_anomaly(broken_log: Path) -> None:
    every = read(broken_log).marks(1, MARKED, MARKED).anomalies
    ticks = [tick for tick, some in enumerate(every, 1) if some]
    page = await page_at(broken_log, 1)
    await page.wait_for_selector("#strip .anomalies")
    for tick in ticks:
        await page.keyboard.press("n")
        await wait_shown(page, tick)
    await page.keyboard.press("n")
    await expect(page.locator("#said")).to_have_text(
        "no anomaly or alarm after this tick"
    )
    await go_to(page, MARKED)
    for tick in reversed(ticks):
        await page.click("#anomaly-back")
        await wait_shown(page, tick)
    await page.keyboard.press("g")
    await expect(page.locator("#goto-list")).to_contain_text("this tick has no clock")


@pytest.mark.slow
async def test_the_strip_shows_what_happened(
    broken_log: Path, planner_log: Path, lamp_log: Path, path_log: Path, tmp_path: Path
) -> None:
    gone = range(10, 14)
    gaps = without_states(path_log, tmp_path / "gaps.mcap", gone)
    for log, kind, words in [
        (broken_log, "anomalies", "1 tick with an anomaly"),
        (broken_log, "begins", "1 beginning of a trajectory"),
        (planner_log, "reached", "target reached"),
        (lamp_log, "born", "1 sensor grown"),
        (gaps, "missing", "1 tick not recorded"),
    ]:
        history, last = read(log), RunView(log).last
        counts = getattr(history.marks(1, last, last), kind)
        ticks = [tick for tick, some in enumerate(counts, 1) if some]
        assert ticks == {"born": [BIRTH], "missing": [*gone]}.get(kind, ticks)
        assert ticks
        async with opened(log, "#t=1") as page:
            await expect(page.locator(f"#strip .{kind}")).to_have_count(len(ticks))
            for number, tick in enumerate(ticks):
                # The strip becomes shorter once there are anomalies to go to.
                await wait_until(
                    page,
                    f"""Math.abs(
                        document.querySelectorAll("#strip .{kind}")[{number}].getBBox().x
                        - 8 - (document.querySelector("#strip").clientWidth - 16)
                        * {(tick - 0.5) / last}) < 8""",
                )
                strip: Any = await page.locator("#strip").bounding_box()
                place = 8 + (strip["width"] - 16) * (tick - 0.5) / last
                await page.mouse.move(0, 0)  # one that is there already does not move
                await page.locator("#strip").hover(position={"x": place, "y": 9})
                # A tick that is not there has no time.
                title = re.compile(rf"tick {tick}(, .+)?: .*{words}")
                await expect(page.locator("#strip title")).to_have_text(title)
                if number == 0:  # drawn anew under a resting pointer, it says the same
                    await page.evaluate("""document.querySelector("#strip").append("old");
                        document.querySelector("#strip").style.height = "19px";""")
                    await expect(page.locator("#strip")).not_to_contain_text("old")
                    await expect(page.locator("#strip title")).to_have_text(title)
                if kind != "missing":
                    await page.locator("#strip").click(position={"x": place, "y": 5})
                    await wait_shown(page, tick)
            said = await page.get_attribute("#strip", "aria-label")
            assert re.search(rf"\b({sum(counts)} |target reached)", str(said))
