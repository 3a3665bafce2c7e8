"""The strip over the slider, and the card of an anomaly, in a real browser."""

from pathlib import Path

import pytest
from msgspec.structs import replace
from playwright.async_api import expect

from neurosnap.apps.viewer.marks import RunMarks
from neurosnap.apps.viewer.run_view import RunView
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import csv_run, recorded
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
        await page.wait_for_selector("#strip .anomaly")
        drawn = await page.evaluate(
            """() => [".anomaly", ".rewired", ".begins"].map(
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
        await page.wait_for_selector("#strip .anomaly")
        for tick in ticks:
            await page.keyboard.press("n")
            await wait_shown(page, tick)
        await page.keyboard.press("n")
        await expect(page.locator("#said")).to_have_text("no anomaly after this tick")
        await go_to(page, TICKS)
        for tick in reversed(ticks):
            await page.click("#anomaly-back")
            await wait_shown(page, tick)


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
