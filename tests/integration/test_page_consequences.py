"""What a sensor implies, what was learned in a range, and what the page opens with."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from playwright.async_api import expect

from neurosnap.apps.viewer.run_view import RunView
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.recorded_runs import TICKS, csv_run, recorded
from tools.browser import wait_shown

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def broken_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which a rule is broken at tick 25."""
    folder = tmp_path_factory.mktemp("broken")
    options = replace(csv_run(folder / "rows.csv"), watch=True, support=2)
    return recorded(options, folder / "run.mcap")


async def test_a_sensor_says_what_would_follow_if_it_were_on_or_off(
    planner_log: Path,
) -> None:
    view = RunView(planner_log)
    names = view.options.sensors
    graph = view.snapshot(TICKS).poc_graph()
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        told = await page.evaluate(
            """async () => {
                const { consequences } = await import("/tick/consequences.js");
                const { page } = await import("/main.js");
                const ids = [...Array(2 * page.names.length).keys()];
                const far = page.names.map((_, sensor) => `s${sensor}`);
                return ids.map((literal) => consequences(literal, page.graph, far));
            }"""
        )
        for literal, words in enumerate(told):
            above = np.zeros(2 * len(names), np.bool_)
            above[literal] = True
            above = graph.up(above)
            above[[literal, literal ^ 1]] = False
            expected = {
                word: {f"s{sensor}" for sensor in np.flatnonzero(above[half::2])}
                for half, word in enumerate(("on", "off"))
            }
            groups = [] if words == "nothing follows" else words.split("; ")
            found = dict(group.split(": ") for group in groups)
            assert set(found) == {word for word, some in expected.items() if some}
            for word, text in found.items():
                first, _, more = text.partition(" and ")
                named = first.split(", ")
                assert set(named) <= expected[word]
                left = int(more.split()[0]) if more else 0
                assert len(named) + left == len(expected[word])
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").first.click()
        body = page.locator("#choice-body")
        await expect(body).to_contain_text("if on")
        await expect(body).to_contain_text("if off")


async def test_two_that_exclude_each_other_say_so_both(planner_log: Path) -> None:
    view = RunView(planner_log)
    names = view.options.sensors
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        await page.click("#tab-sensors")
        rows = page.locator("#outline tbody tr")
        pairs = [
            (arrow.source >> 1, arrow.target >> 1)
            for arrow in view.graph(TICKS).edges
            if not arrow.source & 1 and arrow.target & 1
        ]
        assert pairs
        for one, other in pairs:
            for here, there in ((one, other), (other, one)):
                told = await rows.nth(here).locator(".implies").inner_text()
                assert f"⊣ {names[there]}" in told.split("; ")


async def test_what_was_learned_in_a_range_is_one_click_away(
    planner_log: Path,
) -> None:
    async with opened(planner_log, "#t=3&range=5-20") as page:
        await wait_shown(page, 3)
        await page.click("#range-compare")
        await wait_shown(page, 20)
        await expect(page.locator("#tab-compare")).to_be_focused()
        heads = page.locator("#compare .differences thead th")
        await expect(heads.nth(0)).to_have_text("tick 20")
        await expect(heads.nth(1)).to_have_text("tick 5")
        # However long the lists beside it are, its rows stand together.
        table = page.locator("#compare .differences > table")
        assert await table.locator("tbody tr").count() == 3
        box = await table.bounding_box()
        assert box is not None
        assert box["height"] < 120
        await page.keyboard.press("x")
        await expect(page.locator("#range-compare")).to_be_hidden()


async def test_a_suspect_is_not_said_to_be_believed_without_a_doubt(
    broken_log: Path,
) -> None:
    view = RunView(broken_log)
    frame = next(one for one in view.frames(1, TICKS) if one.anomaly)
    assert frame.anomaly is not None
    suspects = {*frame.anomaly.culprits, *frame.anomaly.others}
    async with opened(broken_log, f"#t={frame.tick}") as page:
        await wait_shown(page, frame.tick)
        await page.click("#tab-sensors")
        buttons = page.locator("#outline tbody button")
        for sensor in range(len(view.options.sensors)):
            await buttons.nth(sensor).click()
            doubted = "may be wrong" in await page.inner_text("#choice-body")
            assert doubted == (sensor in suspects)
        await go_to(page, frame.tick - 1)
        await expect(page.locator("#choice-body")).not_to_contain_text("may be wrong")


async def test_a_wave_that_goes_nowhere_does_not_hide_the_state(
    path_log: Path, unread_log: Path
) -> None:
    shown = """async () => {
        const { page } = await import("/main.js");
        page.wave.run(0.5);
        return page.wave.shown !== null;
    }"""
    async with opened(path_log, "#t=9") as page:
        await wait_shown(page, 9)
        assert not await page.evaluate(shown)
    async with opened(unread_log, "#t=31") as page:  # a sensor is predicted
        await wait_shown(page, 31)
        assert await page.evaluate(shown)


async def test_the_page_says_why_it_opens_where_it_does(planner_log: Path) -> None:
    async with opened(planner_log) as page:
        tick = int(await page.get_attribute("#drawing", "data-tick") or 0)
        assert tick > 1
        said = page.locator("#wave-why")
        await expect(said).to_contain_text("The page opens at the deepest wave")
        await page.keyboard.press("ArrowLeft")
        await wait_shown(page, tick - 1)
        await expect(said).not_to_contain_text("opens at")


async def test_a_tick_says_that_a_trajectory_begins(planner_log: Path) -> None:
    begins = [f.tick for f in RunView(planner_log).frames(1, TICKS) if f.begins]
    async with opened(planner_log, f"#t={begins[0]}") as page:
        await wait_shown(page, begins[0])
        await expect(page.locator("#now-begins")).to_be_visible()
        await go_to(page, begins[0] + 1)
        await expect(page.locator("#now-begins")).to_be_hidden()
