"""Several recordings in one server, and two beside each other, in a real browser."""

from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace
from playwright.async_api import expect

from neurosnap.apps.viewer.listed_runs import Runs
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.apps.viewer.tick_difference import TickDifference, difference
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.page_requests import get
from tests.support.recorded_runs import csv_run, recorded
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

TICKS = 40
LISTED = 8  # edges that are listed before all are asked for


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two runs of the same readings; the second learns later, and stops earlier."""
    folder = tmp_path_factory.mktemp("compare")
    run = csv_run(folder / "rows.csv", TICKS)
    other = folder / "other"
    other.mkdir()
    cautious = replace(run, threshold=0.01, snapshot="discounted", decay=0.9)
    return recorded(run, folder / "run.mcap"), recorded(cautious, other / "run.mcap")


async def test_each_recording_of_a_server_is_asked_by_its_number(
    logs: tuple[Path, Path],
) -> None:
    async with serving(*map(ViewSession, logs)) as address:
        _, body = await get(address, "/api/runs")
        runs = msgspec.json.decode(body, type=Runs).runs
        assert [each.name for each in runs] == [
            f"{logs[0].parent.name}/run.mcap",
            "other/run.mcap",
        ]
        for number, log in enumerate(logs):
            _, body = await get(address, f"/api/graph?tick=30&run={number}")
            own = msgspec.json.decode(body)["id"]
            assert own == RunView(log).graph(30).id
        _, body = await get(address, "/api/difference?tick=30&other=1&then=20")
        found = msgspec.json.decode(body, type=TickDifference)
        assert found == difference(RunView(logs[0]), 30, RunView(logs[1]), 20)
        for query, words in {
            "run=2": "run: must be in [0, 1], got 2",
            "run=x": "run: must be a whole number from 0 up",
        }.items():
            status, body = await get(address, f"/api/run?{query}")
            assert status == 400
            assert words in body.decode()
        status, body = await get(address, "/api/partings?other=7")
        assert (status, b"other: must be in [0, 1]" in body) == (400, True)


async def test_another_recording_is_chosen_and_a_link_leads_to_it(
    logs: tuple[Path, Path],
) -> None:
    async with opened(logs[0], "#t=12", "light", logs[1]) as page:
        await wait_shown(page, 12)
        assert await page.locator("#run option").all_inner_texts() == [
            f"{logs[0].parent.name}/run.mcap",
            "other/run.mcap",
        ]
        await expect(page.locator("#what")).to_contain_text(
            RunView(logs[0]).recording.swarm
        )
        await page.select_option("#run", "1")
        await expect(page.locator("#what")).to_contain_text(
            RunView(logs[1]).recording.swarm
        )
        await wait_shown(page, 12)
        assert await page.evaluate("location.hash") == "#t=12&run=1"
        assert await page.locator("#run").input_value() == "1"


async def test_one_recording_has_nothing_to_choose(csv_log: Path) -> None:
    async with opened(csv_log, "#t=12") as page:
        await wait_shown(page, 12)
        await page.click("#tab-compare")
        await page.wait_for_selector("#compare section")
        await expect(page.locator("#run")).to_be_hidden()
        assert await page.locator("#compare figure").is_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_it_says_where_two_recordings_part(
    logs: tuple[Path, Path], scheme: Scheme
) -> None:
    views = [RunView(log) for log in logs]
    frames = [view.frames(1, TICKS) for view in views]
    parted = next(
        one.tick for one, other in zip(*frames, strict=True) if one.state != other.state
    )
    async with opened(logs[0], "#t=30", scheme, logs[1]) as page:
        await wait_shown(page, 30)
        await page.click("#tab-compare")
        parts = page.locator("#compare ul").first
        await expect(parts).to_contain_text("readings: the same")
        await expect(parts).to_contain_text(f"believed states part at tick {parted}")
        await page.wait_for_selector("#compare figure .u-over")
        found = difference(views[0], 30, views[1], 30)
        assert found.here.edge_count > 0
        heading = page.get_by_text("Implied here, not in other/run.mcap")
        await expect(heading).to_contain_text(str(found.here.edge_count))
        assert await faults(page) == []
        await parts.get_by_role("button", name=f"tick {parted}").first.click()
        await wait_shown(page, parted)
        felt = difference(views[0], parted, views[1], parted).felt
        assert felt
        shown = page.get_by_role("table", name="Sensors that differ")
        await expect(shown.locator("tbody tr")).to_have_count(len(felt))
        await shown.get_by_role("button", name=felt[0].name).click()
        assert await page.inner_text("#choice-title") == felt[0].name


async def test_it_says_what_was_learned_between_two_ticks(path_log: Path) -> None:
    view = RunView(path_log)
    names = view.options.sensors
    pairs = ((tick, then) for tick in range(30, 40) for then in range(3, 30))
    tick, then, found = next(
        (tick, then, found)
        for tick, then in pairs
        if 0 < (found := difference(view, tick, view, then)).here.edge_count <= LISTED
    )
    async with opened(path_log, f"#t={tick}") as page:
        await wait_shown(page, tick)
        await page.click("#tab-compare")
        await page.get_by_label("Tick to compare with").fill(str(then))
        learned = page.locator("#compare section").filter(
            has_text=f"Implied at tick {tick}, not at tick {then} "
        )
        edges = learned.get_by_role("button")
        await expect(edges).to_have_count(found.here.edge_count)
        first = found.here.edges[0]
        text = await edges.first.inner_text()
        assert names[first.source >> 1] in text
        assert names[first.target >> 1] in text
        await edges.first.click()
        assert await page.inner_text("#choice-title") == "Selected edge"
        await page.get_by_label("Tick to compare with").fill("")
        await go_to(page, 31)
        await expect(page.locator("#compare")).to_contain_text(
            "Implied at tick 31, not at tick 30"
        )


async def test_a_tick_that_is_not_there_is_refused(path_log: Path) -> None:
    refused = "the server responded with a status of 400"
    async with opened(path_log, "#t=30", but_for=refused) as page:
        await page.click("#tab-compare")
        await page.get_by_label("Tick to compare with").fill("99")
        await expect(page.locator("#compare")).to_contain_text(
            "tick: must be in [0, 40], got 99"
        )


async def test_what_others_contradict_each_other_about_is_not_called_unknown(
    torn_log: Path,
) -> None:
    last = RunView(torn_log).last
    async with opened(torn_log, f"#t={last}") as page:
        await wait_shown(page, last)
        await page.click("#tab-compare")
        row = page.get_by_role("table", name="Sensors that differ").get_by_role("row")
        await expect(row.filter(has_text="s1").get_by_role("cell")).to_have_text(
            ["reads unknown, believed contradicted", "reads unknown, believed on"]
        )
