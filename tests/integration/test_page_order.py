"""The learned order on the page: drawing, focus and descriptions."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.async_api import Page, expect

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from tests.support.browser_pages import IN_BROWSER, go_to, opened, page_at
from tests.support.page_requests import read
from tests.support.recorded_runs import TICKS, path_run, recorded
from tools.browser import wait_shown, wait_until

pytestmark = IN_BROWSER

SEEN = """async () => {
    const { page } = await import("/main.js");
    const { sensors } = page.order.diagram._focus;
    return sensors && [...sensors].sort((a, b) => a - b);
}"""
LAID = """() => [...document.querySelectorAll("#drawing [data-sensor]")]
    .map(({ dataset }) => Number(dataset.sensor)).sort((a, b) => a - b)"""
EDGES = """() => [...document.querySelectorAll("#drawing [data-edge]")]
    .map(({ dataset }) => dataset.edge.split("-").map(Number))"""
LINES = """([all, own]) => [...document.querySelectorAll(`#drawing ${all}`)].map((line) => {
    const style = getComputedStyle(line.matches(own) ? line : line.querySelector(own));
    const edge = line.dataset.edge?.split("-").map(Number);
    return [edge, parseFloat(style.strokeWidth), style.strokeDasharray !== "none"];
})"""
TESTED = """async () => (await import("/main.js")).page.order.graph.testedBy"""
CHOOSE = """async (thing) => (await import("/main.js")).page.choose(thing)"""
WAY = [1, 5, 14, 20, TICKS, 5, 20, 21, 20]


async def test_each_edge_of_the_order_is_drawn_and_its_height_is_said(
    planner_log: Path,
) -> None:
    view = RunView(planner_log)
    page = await page_at(planner_log, 1)
    for tick in (3, 17, TICKS):
        await go_to(page, tick)
        graph, drawn = view.graph(tick), await page.evaluate(EDGES)
        edges = [(edge.source, edge.target) for edge in graph.edges]
        # Of an edge and its contrapositive one is drawn.
        one, other = (
            {min((a, b), (b ^ 1, a ^ 1)) for a, b in e} for e in (drawn, edges)
        )
        assert (one, len(drawn)) == (other, len(edges))
        facts = await page.inner_text("#diagram-facts")
        assert facts.endswith(f"height {graph.height}")


@pytest.mark.slow
async def test_no_two_nodes_overlap_and_what_is_implied_stands_above(
    planner_log: Path,
) -> None:
    page = await page_at(planner_log, TICKS)
    places, edges = await page.evaluate(
        """async () => {
            const { diagram } = (await import("/main.js")).page.order;
            const places = diagram._laid.places;
            const of = (item) => places.get(item.sensor).y;
            return [
                [...places.values()].map(({ x, y, width, item: { sensor } }) =>
                    [x, y, width, diagram._nodes.get(sensor).querySelector(".name").getBBox()]
                ).map(([x, y, width, name]) => [x, y, width, name.x, name.width]),
                diagram._lines.map(({ link }) => link).filter(({ edge }) =>
                    edge.source % 2 === 0 && edge.target % 2 === 0,
                ).map(({ from, to }) => [of(from), of(to)]),
            ];
        }"""
    )
    for k, (x, y, width, name, name_width) in enumerate(places):
        # The name stands in its own part of the pill, beside 16 pixels for the other.
        assert 3 < name + width / 2 < width - 16 - name_width
        for other_x, other_y, other_width, *_ in places[:k]:
            aside = abs(x - other_x) >= (width + other_width) / 2
            assert aside or abs(y - other_y) >= 20
    assert edges
    assert all(above < below for below, above in edges)


@pytest.mark.slow
async def test_whatever_is_equivalent_says_to_what(planner_log: Path) -> None:
    snapshot = RunView(planner_log).learned(TICKS).snapshot
    sensorium = snapshot.sensorium
    first, *others = max(snapshot.poc_graph().classes(), key=len)
    assert len(others) > 10
    page = await page_at(planner_log, TICKS)
    await page.click("#tab-sensors")
    implies = page.locator("#outline td.implies")
    for literal in others:
        said = f"{sensorium.name(literal)} ≡ {sensorium.name(first)}"
        await expect(implies.nth(literal >> 1)).to_contain_text(said)
    more = f" and {len(others) - 8} more"
    await expect(implies.nth(first >> 1)).to_contain_text(more)
    await page.locator("#outline tbody button").nth(others[0] >> 1).click()
    await expect(page.locator("#choice-body")).to_contain_text(
        f"Its edges are those of {sensorium.name(first & ~1)}."
    )


async def test_an_edge_that_is_clicked_shows_its_weights(path_log: Path) -> None:
    view = RunView(path_log)
    page = await page_at(path_log, 30)
    source, target, x, y = await page.evaluate(
        """() => {
            for (const line of document.querySelectorAll("#drawing .near")) {
                const at = line.getPointAtLength(line.getTotalLength() / 2);
                const { x, y } = at.matrixTransform(line.getScreenCTM());
                const { edge } = line.parentNode.dataset;
                // Not one that passes behind a node or another line there.
                const there = document.elementFromPoint(x, y);
                if (there.closest("[data-edge]") === line.parentNode)
                    return [...edge.split("-").map(Number), x, y];
            }
        }"""
    )
    await page.mouse.click(x, y)
    for tick in (30, 12):
        await go_to(page, tick)
        await page.wait_for_selector(f'#choice-body[data-tick="{tick}"]')
        seen = await page.locator("#edge td").all_inner_texts()
        edge = view.edge(source, target, tick)
        assert list(map(float, seen[:4])) == list(edge.weights)
        assert float(seen[4]) == pytest.approx(edge.threshold, abs=1e-4)
    await page.keyboard.press("Escape")
    await expect(page.locator("#choice")).to_be_hidden()
    for button in ("right", "middle"):
        await page.mouse.click(x, y, button=button)
        await expect(page.locator("#choice")).to_be_hidden()


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which some relations are tested more often than others."""
    return recorded(path_run(200), tmp_path_factory.mktemp("long") / "run.mcap")


@pytest.mark.slow
async def test_a_relation_is_as_wide_as_it_was_tested_and_dotted_if_it_was_not(
    long_log: Path,
) -> None:
    history, view = read(long_log), RunView(long_log)
    async with opened(long_log, "#t=40") as page:
        for tick, same in (40, 4), (200, 0):
            await go_to(page, tick)
            await wait_until(page, f"({TESTED})().then((by) => by === {tick})")
            graph = view.graph(tick)
            told = history.tested(tick, graph)
            tests = dict[frozenset[int], int]()  # of an edge, and of its contrapositive
            for edge, tested in zip(graph.edges, told.edges, strict=True):
                tests[frozenset((edge.source, edge.target))] = tested
                tests[frozenset((edge.source ^ 1, edge.target ^ 1))] = tested
            lines = await page.evaluate(LINES, [".link", ".line"])
            widths = sorted({(tests[frozenset(edge)], wide) for edge, wide, _ in lines})
            assert len(lines) == len(graph.edges)
            assert not any(dotted for _, _, dotted in lines)
            # The more occasions, the wider.
            assert len(widths) == len(set(told.edges))
            assert all(few[1] < more[1] for few, more in pairwise(widths))
            # Sensors that never changed were never told apart.
            ties = await page.evaluate(LINES, [".tie", ".tie"])
            assert not any(told.nodes)
            assert len(ties) == sum(len(each) - 1 for each in graph.classes) == same
            assert all(dotted for _, _, dotted in ties)
            # The cards say it, too.
            body = page.locator("#choice-body")
            for members in graph.classes:
                await page.evaluate(CHOOSE, {"sensor": members[0] >> 1})
                await expect(body).to_contain_text("not tested yet")
            source, target = lines[0][0]
            await page.evaluate(CHOOSE, {"edge": {"source": source, "target": target}})
            count = tests[frozenset((source, target))]
            await expect(body).to_contain_text(f"tested on {count} occasion")
            await page.evaluate(CHOOSE, None)
            seldom = page.get_by_role("button", name="under 10 tests")
            await seldom.click()
            well = sum(count > 9 for count in told.edges)
            await expect(page.locator("#drawing .link.gone")).to_have_count(well)
            await seldom.click()
            assert well or tick == 40
        await expect(page.locator(".legend .untested")).to_be_visible()


def related(log: Path, tick: int, sensor: int) -> list[int]:
    """Return the sensors that have a literal above or below one of a sensor's."""
    graph = RunView(log).learned(tick).snapshot.poc_graph()
    above = graph.up([2 * sensor, 2 * sensor + 1])
    return sorted({literal >> 1 for literal in np.flatnonzero(above).tolist()})


async def pick(page: Page, sensor: int) -> None:
    await page.click("#tab-sensors")
    await page.locator("#outline tbody button").nth(sensor).click()


async def test_a_selected_sensor_leaves_clear_what_is_above_and_below_it(
    planner_log: Path,
) -> None:
    sensor = 3
    truth = related(planner_log, TICKS, sensor)
    page = await page_at(planner_log, TICKS)
    assert await page.evaluate(SEEN) is None
    await expect(page.locator("#focus-depth")).to_be_disabled()
    await pick(page, sensor)
    assert await page.evaluate(SEEN) == truth
    await page.select_option("#focus-depth", "1")
    near = await page.evaluate(SEEN)
    await page.select_option("#focus-depth", "2")
    farther = await page.evaluate(SEEN)
    assert sensor in near
    assert set(near) < set(farther) <= set(truth) < set(range(40))
    dim = await page.locator("#drawing .node.dim").evaluate_all(
        "(all) => all.map(({ dataset }) => Number(dataset.sensor))"
    )
    assert set(dim) == set(range(40)) - set(farther)
    await page.select_option("#focus-depth", "Infinity")
    chips = page.locator("#focus-edges button")
    for chip, (kind, word) in enumerate(
        [("excite", "excites"), ("inhibit", "inhibits")]
    ):
        count = await page.locator(f"#drawing .link.{kind}").count()
        await expect(chips.nth(chip)).to_have_text(f"{word} {count}")
    await chips.first.focus()
    await page.keyboard.press("Enter")
    await expect(chips.first).to_have_attribute("aria-pressed", "false")
    assert set(await page.evaluate(SEEN)) < set(truth)
    await page.keyboard.press("Escape")
    assert await page.evaluate(SEEN) is None


@pytest.mark.slow
async def test_what_is_looked_at_is_laid_out_alone(planner_log: Path) -> None:
    sensor = 3
    truth = related(planner_log, TICKS, sensor)
    page = await page_at(planner_log, TICKS)
    await page.locator(f"#drawing [data-sensor='{sensor}']").dblclick()
    assert await page.evaluate(LAID) == truth
    shown = f"{len(truth)} of them shown"
    await expect(page.locator("#diagram-facts")).to_contain_text(shown)
    await page.press("body", "f")
    assert await page.evaluate(LAID) == list(range(40))
    await page.press("body", "f")
    assert await page.evaluate(LAID) == truth
    await page.keyboard.press("Escape")
    assert await page.evaluate(LAID) == list(range(40))


@pytest.mark.slow
async def test_only_what_is_predicted_or_contradicted_is_kept(unread_log: Path) -> None:
    page = await page_at(unread_log, 31)
    chip = page.locator("#focus-only button")
    there = page.locator("#focus-only button:visible")
    await expect(there).to_have_text(["on 2", "predicted 1", "under 10 tests 3"])
    await chip.nth(2).click()
    assert await page.evaluate(SEEN) == [1]
    await page.click("#focus-alone")
    assert await page.evaluate(LAID) == [1]
    await chip.nth(2).click()
    await page.press("body", "ArrowRight")
    await wait_shown(page, 32)
    await chip.nth(1).click()
    assert await page.evaluate(LAID) == [0, 1]  # each says the other is wrong


async def places(page: Page, tick: int) -> dict[str, Any]:
    """Return where each sensor stands, and is seen, at a tick."""
    await go_to(page, tick)
    found: dict[str, Any] = await page.evaluate(
        """async (tick) => {
            const { page } = await import("/main.js");
            const { diagram } = page.order;
            const frame = () => new Promise(requestAnimationFrame);
            while (page.frame.tick !== tick || page.order.graph?.id !== page.frame.graph
                || diagram._graph?.id !== page.order.graph.id) await frame();
            const found = {};
            for (const [key, node] of diagram._nodes) {
                const { x, y } = node.getBoundingClientRect();
                found[key] = [x, y];
            }
            return found;
        }""",
        tick,
    )
    return found


@pytest.mark.slow
async def test_it_is_the_same_whichever_way_one_came(planner_log: Path) -> None:
    seen: dict[int, list[Any]] = {}
    page = await page_at(planner_log, TICKS)
    await page.click("#fit")
    for tick in WAY:
        seen.setdefault(tick, []).append(await places(page, tick))
    for tick, found in seen.items():
        assert all(each == found[0] for each in found), tick
    assert len(seen[20][0]) > 1
    assert seen[20][0] != seen[1][0]


async def test_of_too_many_sensors_those_are_drawn_that_are_asked_for(
    large_log: Path,
) -> None:
    names = Recording.open(large_log).options.sensors
    async with opened(large_log, "#t=6") as page:
        large = page.locator("#drawing-large")
        await expect(large).to_contain_text("500 sensors are too many to be read")
        assert await page.evaluate(LAID) == []
        await page.fill("#search-text", names[210])
        await expect(large).to_be_hidden()
        assert await page.evaluate(LAID) == [210]
        await page.press("#search-text", "Enter")
        await expect(page.locator("#choice-title")).to_have_text(names[210])
        await page.select_option("#focus-depth", "1")
        near = await page.evaluate(LAID)
        assert 210 in near
        assert 1 < len(near) <= 160
        await page.fill("#search-text", "")
        await page.keyboard.press("Escape")
        await page.press("body", "Escape")
        await expect(large).to_be_visible()
