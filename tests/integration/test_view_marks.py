"""The strip over the slider, and the card of an anomaly, in a real browser."""

import re
from pathlib import Path

import pytest
from msgspec.structs import replace
from playwright.async_api import expect

from neurosnap.apps.viewer.health_view import HealthView
from neurosnap.apps.viewer.marks import RunMarks
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.time_series import TimeSeries
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.home_runs import FLUSH
from tests.support.lamp import BIRTH
from tests.support.page_faults import faults
from tests.support.recorded_runs import csv_run, recorded, without_states
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

TICKS = 60


@pytest.fixture(scope="module")
def broken_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which a rule is broken."""
    folder = tmp_path_factory.mktemp("marks")
    options = replace(csv_run(folder / "rows.csv", TICKS), watch=True, support=2)
    return recorded(options, folder / "run.mcap")


def marked(log: Path) -> RunMarks:
    marks = RunMarks(RunView(log))
    while marks.read_on():
        pass
    return marks


async def test_the_strip_shows_what_happened(broken_log: Path) -> None:
    marks = marked(broken_log).marks(1, TICKS, TICKS)
    async with opened(broken_log) as page:
        await page.wait_for_selector("#strip .anomalies")
        drawn = await page.evaluate(
            """() => [".anomalies", ".rewired", ".begins"].map(
                (kind) => document.querySelectorAll(`#strip ${kind}`).length)"""
        )
        some = (marks.anomalies, marks.rewired, marks.begins)
        assert drawn == [sum(map(bool, counts)) for counts in some]
        said = await page.get_attribute("#strip", "aria-label")
        assert f"{sum(marks.anomalies)} tick" in str(said)
        box = await page.locator("#strip").bounding_box()
        assert box is not None
        first = marks.anomalies.index(1) + 1
        across = 8 + (box["width"] - 16) * (first - 0.5) / TICKS
        await page.locator("#strip").hover(position={"x": across, "y": 5})
        title = await page.locator("#strip title").text_content()
        assert str(title).startswith(f"tick {first}, ")
        assert "1 tick with an anomaly" in str(title)
        await page.locator("#strip").click(position={"x": across, "y": 5})
        await wait_shown(page, first)


async def test_n_and_p_go_from_anomaly_to_anomaly(broken_log: Path) -> None:
    every = marked(broken_log).marks(1, TICKS, TICKS).anomalies
    ticks = [tick for tick, some in enumerate(every, 1) if some]
    async with opened(broken_log, "#t=1") as page:
        await page.wait_for_selector("#strip .anomalies")
        for tick in ticks:
            await page.keyboard.press("n")
            await wait_shown(page, tick)
        await page.keyboard.press("n")
        await expect(page.locator("#said")).to_have_text(
            "no anomaly or alarm after this tick"
        )
        await go_to(page, TICKS)
        for tick in reversed(ticks):
            await page.click("#anomaly-back")
            await wait_shown(page, tick)


async def test_targets_births_and_gaps_are_marked(
    planner_log: Path, lamp_log: Path, path_log: Path, tmp_path: Path
) -> None:
    series = TimeSeries(RunView(planner_log))
    while series.read_on():
        pass
    gone = range(10, 14)
    gaps = without_states(path_log, tmp_path / "gaps.mcap", gone)
    for log, kind, ticks, words in [
        (planner_log, "reached", series.reached(), "target reached"),
        (lamp_log, "born", [BIRTH], "1 sensor grown"),
        (gaps, "missing", gone, "1 tick not recorded"),
    ]:
        last = RunView(log).last
        async with opened(log, "#t=1") as page:
            signs = page.locator(f"#strip .{kind}")
            await expect(signs).to_have_count(len(ticks))
            strip = await page.locator("#strip").bounding_box()
            assert strip is not None
            for sign, tick in zip(await signs.all(), ticks, strict=True):
                place = 8 + (strip["width"] - 16) * (tick - 0.5) / last
                box = await sign.bounding_box()
                assert box is not None
                assert abs(box["x"] - strip["x"] - place) < 8
                await page.locator("#strip").hover(position={"x": place, "y": 9})
                title = await page.locator("#strip title").text_content()
                # A tick that is not there has no time.
                assert re.match(rf"tick {tick}(, .+)?: .*{words}", str(title))


async def test_an_alarm_is_marked_and_gone_to(home_log: Path) -> None:
    health = HealthView(RunView(home_log))
    while health.read_on():
        pass
    *_, alarm = health.raised
    assert alarm.sensor == FLUSH
    assert alarm.until is None
    async with opened(home_log, "#t=1") as page:
        signs = page.locator("#strip .alarm")
        await expect(signs).to_have_count(len(health.raised))
        said = await page.get_attribute("#strip", "aria-label")
        assert f"{len(health.raised)} alarm" in str(said)
        await go_to(page, alarm.tick - 1)
        told = marked(home_log).marks(1, 10**6, 10**6).anomalies
        assert alarm.tick not in [at for at, some in enumerate(told, 1) if some]
        await page.keyboard.press("n")
        await wait_shown(page, alarm.tick)
        card = page.locator("#alarms")
        await expect(card).to_contain_text(alarm.line)
        assert await faults(page) == []
        await card.get_by_role("button", name="flush").click()
        await expect(page.locator("#choice-title")).to_have_text("flush")
        await go_to(page, alarm.tick - 1)
        await expect(card).to_be_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_the_card_names_what_may_be_wrong(
    broken_log: Path, scheme: Scheme
) -> None:
    view = RunView(broken_log)
    frame = next(one for one in view.frames(1, TICKS) if one.anomaly)
    assert frame.anomaly is not None
    names = view.options.sensors
    async with opened(broken_log, f"#t={frame.tick}", scheme) as page:
        card = page.locator("#anomaly")
        text = await card.inner_text()
        for sensor in (*frame.anomaly.culprits, *frame.anomaly.others):
            assert names[sensor] in text
        assert frame.anomaly.broken[0].evidence in text
        assert await faults(page) == []
        await card.locator("p button").first.click()
        first = (*frame.anomaly.culprits, *frame.anomaly.others)[0]
        assert await page.inner_text("#choice-title") == names[first]
        await card.locator("li button").first.click()
        assert await page.inner_text("#choice-title") == "Selected edge"
        await go_to(page, frame.tick - 1)
        await expect(card).to_be_hidden()
