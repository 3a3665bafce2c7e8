"""Moving through a recording on the page of `neurosnap view`, in a real browser.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

import random
import re
from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of
from tests.support.browser_pages import (
    IN_BROWSER,
    derived,
    go_to,
    opened,
    shown_tick,
    states,
)
from tests.support.recorded_runs import (
    TICKS,
    in_chunks,
)
from tools.browser import wait_shown, wait_until

pytestmark = IN_BROWSER


async def test_playing_goes_on_and_stops_at_the_end(path_log: Path) -> None:
    truth = derived(path_log)
    async with opened(path_log, "#t=20") as page:
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


async def test_it_plays_as_fast_as_it_was_told(path_log: Path) -> None:
    async with opened(path_log) as page:
        gone = await page.evaluate(
            """async () => {
                const { Player, SPEEDS } = await import("/time/player.js");
                const gone = [];
                for (const speed of SPEEDS) {
                    const on = { ready: () => true, move() {}, change() {} };
                    const player = new Player(on);
                    player.setRange(1, 1000);
                    player.setSpeed(speed);
                    player.play();
                    player._advance(5000);
                    const began = player.position;
                    for (let k = 1; k <= 20; k += 1) player._advance(5000 + 100 * k);
                    gone.push([speed, player.position - began]);
                    player.pause();
                }
                return gone;
            }"""
        )
    assert len(gone) == 8
    for speed, ticks in gone:
        assert ticks == pytest.approx(2 * speed)


async def test_a_frame_that_is_early_or_late_skips_no_tick(path_log: Path) -> None:
    chance = random.Random(2)
    frames = [(k + chance.uniform(-0.4, 0.4)) * 1000 / 60 for k in range(1, 600)]
    async with opened(path_log) as page:
        shown = await page.evaluate(
            """async (frames) => {
                const { Player } = await import("/time/player.js");
                const on = { ready: () => true, move() {}, change() {} };
                const player = new Player(on);
                player.setRange(1, 1000);
                player.setSpeed(60);
                player.play();
                const shown = [0, ...frames].map((frame) => {
                    player._advance(frame);
                    return player.tick;
                });
                player.pause();
                return shown;
            }""",
            frames,
        )
    assert shown == list(range(1, 601))


async def test_a_plot_that_is_clicked_leads_there(path_log: Path) -> None:
    async with opened(path_log) as page:
        await page.wait_for_selector("#plots .u-over")
        over = page.locator("#plots .u-over").first
        box = await over.bounding_box()
        assert box is not None
        await over.click(position={"x": box["width"] - 0.5, "y": 20})
        await wait_shown(page, TICKS)


async def test_the_address_holds_the_tick(path_log: Path) -> None:
    async with opened(path_log, "#t=17") as page:
        await wait_shown(page, 17)
        await page.evaluate("location.hash = 't=9'")
        await wait_shown(page, 9)
        await go_to(page, 21)
        await expect(page).to_have_url(re.compile(r"/#t=21$"))


async def test_everything_goes_by_keyboard(path_log: Path) -> None:
    async with opened(path_log) as page:
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
        await keys.press("l")
        await expect(page.locator("html")).to_have_attribute("data-theme", "dark")
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


async def test_the_slider_of_the_wave_goes_to_its_own_ends(planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS - 1}") as page:
        await wait_shown(page, TICKS - 1)
        await page.select_option("#wave-which", "x_below_1")
        depth = await page.get_attribute("#wave-hop", "max")
        assert depth != "0"
        await page.focus("#wave-hop")
        for key, hop in [("Home", "0"), ("End", depth)]:
            await page.keyboard.press(key)
            assert await page.input_value("#wave-hop") == hop
            label = await page.get_attribute("#time", "aria-valuetext")
            assert label == f"tick {TICKS - 1} of {TICKS}"


async def test_the_tick_is_said_by_the_voice_alone(path_log: Path) -> None:
    async with opened(path_log) as page:
        assert await page.locator("#tick").get_attribute("role") is None
        loud = 'output, [aria-live], [role="status"]'
        assert await page.locator("footer").locator(loud).count() == 0


async def test_a_tick_is_said_to_whoever_cannot_see_it(csv_log: Path) -> None:
    truth = derived(csv_log)
    async with opened(csv_log, "#t=24") as page:
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


async def test_a_sensor_is_found_by_a_part_of_its_name(planner_log: Path) -> None:
    async with opened(planner_log) as page:
        await page.keyboard.press("/")
        await page.keyboard.type("X_below_2")
        found = page.locator("#search-found")
        names = options_of(Recording.open(planner_log)).sensors
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


async def test_a_live_run_appears_and_grows(planner_log: Path, tmp_path: Path) -> None:
    whole = in_chunks(planner_log, tmp_path / "whole.mcap", 4000)
    chunks = Recording.open(whole).files[0].layout.chunks
    data, log = whole.read_bytes(), tmp_path / "live.mcap"
    grown = [chunks[len(chunks) * part // 3].offset for part in (1, 2)]
    log.write_bytes(data[: grown[0]])
    live = True
    truth = derived(whole)
    async with opened(log, grows=lambda: live) as page:
        await expect(page.locator("#badge")).to_have_text("live")
        first = await shown_tick(page)
        assert 1 < first < TICKS
        with log.open("ab") as file:
            file.write(data[grown[0] : grown[1]])
        await wait_until(
            page, f"document.querySelector('#drawing').dataset.tick > {first}"
        )
        await page.click("#tab-sensors")
        second = int(await page.get_attribute("#time", "max") or "0")
        await wait_shown(page, second)
        assert await states(page, second) == truth[second]
        with log.open("ab") as file:
            file.write(data[grown[1] :])
        live = False
        await wait_shown(page, TICKS)
        assert await states(page, TICKS) == truth[TICKS]
        await expect(page.locator("#badge")).to_have_text(f"ended at tick {TICKS}")
        await expect(page.locator("#notice")).to_be_hidden()


async def test_a_broken_recording_says_what_could_be_read(
    path_log: Path, tmp_path: Path
) -> None:
    whole = in_chunks(path_log, tmp_path / "whole.mcap", 4000)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    async with opened(cut) as page:
        notice = page.locator("#notice")
        await expect(notice).to_contain_text("cut short after")
        await page.keyboard.press("End")
        last = int(await page.get_attribute("#time", "max") or "0")
        assert 1 < last < TICKS
        await wait_shown(page, last)
        await page.click("#tab-sensors")
        assert await states(page, last) == derived(path_log)[last]
