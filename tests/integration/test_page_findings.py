"""The findings on the page: their list, their marks, and where a page opens."""

import json
from pathlib import Path

import pytest
from playwright.async_api import Route, expect

from neurosnap.apps.viewer.run_view import RunView
from tests.support.browser_pages import IN_BROWSER, go_to, opened, page_at
from tests.support.command_line import call
from tests.support.home_runs import FLUSH
from tests.support.page_requests import read
from tests.support.recorded_runs import TICKS
from tools.browser import wait_shown, wait_until

pytestmark = IN_BROWSER

SUSPECTS = """async () => {
    const { page: { frame, order: { focus, graph } } } = await import("/main.js");
    const nodes = Array.from({ length: 161 }, (_, k) => graph.nodes[k % graph.nodes.length]);
    return [...focus.of({ ...graph, nodes }, frame, null, null).sensors];
}"""
FRAMED = """async ([sensor, tick]) => {
    const { page: { time: { raster } } } = await import("/main.js");
    const { palette } = await import("/base/dom.js");
    const canvas = document.querySelector("#raster canvas");
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const [x, y] = [raster._begin(tick) - 2, 13 * (sensor + 0.5)].map((one) => one * devicePixelRatio);
    const [...ink] = copy.getImageData(x, y, 1, 1).data;
    return `rgb(${ink.slice(0, 3).join(", ")})` === palette().bad;
}"""


@pytest.mark.slow
async def test_a_run_that_has_ended_opens_at_its_last_finding(broken_log: Path) -> None:
    listed, names = read(broken_log).findings().findings, ("a", "b", "c")
    watched = call("watch", broken_log).stdout
    assert listed
    async with opened(broken_log) as page:
        await wait_shown(page, listed[0].tick)
        tab = page.locator("#tab-findings")
        await expect(tab).to_have_attribute("aria-selected", "true")
        await expect(tab).to_have_text(f"Findings {len(listed)}")
        rows = page.locator("#findings tbody tr")
        for number, one in enumerate(listed):
            assert one.sentence in watched
            cells = await rows.nth(number).locator("th, td").all_inner_texts()
            assert cells[:2] == [names[one.sensors[0]], f"{one.what}\n{one.sentence}"]
            # The readings of a file have no times, but those at which they were read.
            assert cells[2:5] == [f"tick {one.first}", one.lasted or "–", one.state]
            assert cells[5].split() == [names[sensor] for sensor in one.sensors]
            await rows.nth(number).click()
            await wait_shown(page, one.tick)
            await expect(page.locator("#finding p").first).to_have_text(one.sentence)


@pytest.mark.slow
async def test_the_culprit_and_the_broken_rule_are_marked(broken_log: Path) -> None:
    view = RunView(broken_log)
    listed = read(broken_log).findings().findings
    page = await page_at(broken_log, 1)
    await page.click("#tab-raster")
    lost = 0
    for one in listed:
        await go_to(page, one.tick)
        (frame,) = view.frames(one.tick, one.tick)
        assert frame.anomaly is not None
        assert frame.anomaly.rule is not None
        rings = page.locator("#drawing .culprit")
        await expect(rings).to_have_count(len(frame.anomaly.culprits))
        line = page.locator("#drawing .broken")
        await expect(line).to_have_text("broken here")
        named = str(await line.get_attribute("data-edge"))
        ends = {int(end) >> 1 for end in named.split("-")}
        assert ends == {literal >> 1 for literal in frame.anomaly.rule}
        # Where the order of the tick has lost that edge it is drawn all the same.
        edges = {(arrow.source, arrow.target) for arrow in view.graph(one.tick).edges}
        source, target = frame.anomaly.rule
        lost += not {(source, target), (target ^ 1, source ^ 1)} & edges
        await wait_until(page, f"({FRAMED})({[one.sensors[0], one.first]})")
        assert not await page.evaluate(FRAMED, [one.sensors[0], one.first - 5])
    assert lost
    await go_to(page, 2)
    for mark in ("#drawing .culprit", "#drawing .broken", "#finding:visible"):
        await expect(page.locator(mark)).to_have_count(0)


@pytest.mark.slow
async def test_no_suspect_is_believed_plainly(broken_log: Path) -> None:
    frame = next(one for one in RunView(broken_log).frames(1, 60) if one.anomaly)
    assert frame.anomaly is not None
    page = await page_at(broken_log, frame.tick)
    await page.click("#tab-sensors")
    buttons = page.locator("#outline tbody button")
    suspects = [*frame.anomaly.culprits, *frame.anomaly.others]
    for sensor in range(3):
        await buttons.nth(sensor).click()
        doubted = "may be wrong" in await page.inner_text("#choice-body")
        assert doubted == (sensor in suspects)
    rule = [literal >> 1 for literal in frame.anomaly.rule or ()]
    assert set(await page.evaluate(SUSPECTS)) == {*suspects, *rule}


@pytest.mark.slow
async def test_a_run_without_findings_opens_at_its_end_with_its_deepest_wave(
    planner_log: Path,
) -> None:
    (frame,) = RunView(planner_log).frames(TICKS, TICKS)
    deepest = max(wave.depth for wave in frame.waves)
    assert deepest > 0
    async with opened(planner_log) as page:
        await wait_shown(page, TICKS)
        assert await page.get_attribute("#wave-hop", "max") == str(deepest)
        await expect(page.locator("#plots")).to_be_visible()
        await page.click("#tab-findings")
        await expect(page.locator("#findings")).to_contain_text("No findings")
        await expect(page.locator("#findings table")).to_have_count(0)


@pytest.mark.slow
async def test_an_alarm_is_a_finding_and_is_gone_to(home_log: Path) -> None:
    history = read(home_log)
    listed = history.findings().findings
    alarm = listed[0]
    assert (alarm.sensors[0], alarm.what, alarm.last) == (FLUSH, "silent", None)
    assert alarm.first < alarm.tick
    assert alarm.began[:21] in alarm.sentence  # it is told since when in one way
    assert sum(history.marks(1, 10**6, 10**6).alarms) == len(listed)
    page = await page_at(home_log, alarm.tick - 1)
    await expect(page.locator("#strip .alarms")).to_have_count(len(listed))
    row = page.locator("#findings tbody tr").first
    for words in (alarm.sentence, f"tick {alarm.first}", alarm.began, "now"):
        await expect(row).to_contain_text(words)
    await expect(page.locator("#findings")).to_contain_text("8 of 8 sensors known")
    card, ring = page.locator("#finding"), page.locator("#drawing .culprit")
    await expect(card).to_be_hidden()
    await expect(ring).to_have_count(0)
    await page.keyboard.press("n")
    await wait_shown(page, alarm.tick)
    await expect(card).to_contain_text(alarm.sentence)
    await expect(page.locator("#now-at")).to_contain_text(alarm.began[7:15])
    await expect(ring).to_have_count(1)
    await card.get_by_role("button", name="flush").click()
    await expect(page.locator("#choice-title")).to_have_text("flush")
    there = history.beside(alarm.tick)
    for number, tick in [(1, there.day), (2, there.week)]:
        await go_to(page, alarm.tick)
        await page.keyboard.press("g")
        await page.locator("#goto-list button").nth(number).click()
        await wait_shown(page, tick or 0)
    await go_to(page, alarm.tick)
    await page.keyboard.press("g")
    await page.locator("#goto-list button").nth(3).click()
    await expect(page.locator("#compare")).to_contain_text(f", not at tick {there.day}")


@pytest.mark.slow
async def test_the_list_is_made_anew_only_when_something_is_new(
    broken_log: Path,
) -> None:
    async with opened(broken_log, "#t=1&tab=plots") as page:
        await page.wait_for_selector("#findings tbody tr", state="attached")
        await expect(page.locator("#plots")).to_be_visible()  # as the link says
        await expect(page.locator("#tab-findings")).not_to_contain_text("…")
        again = """async () => {
            const { page } = await import("/main.js");
            const table = document.querySelector("#findings table");
            await page.findings.load();
            return table === document.querySelector("#findings table");
        }"""
        assert await page.evaluate(again)

        async def change(route: Route) -> None:
            answer = await (await route.fetch()).json()
            answer["findings"][0]["began"] = "Sol 9 24:37:01 no zone of a browser"
            await route.fulfill(body=json.dumps(answer))

        await page.route("**/api/findings*", change)
        assert not await page.evaluate(again)
        await expect(page.locator("#findings")).to_contain_text("Sol 9 24:37:01")
