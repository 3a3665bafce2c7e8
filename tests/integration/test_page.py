"""The order that the page of `neurosnap view` draws in a real browser.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import expect

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of
from neurosnap.recording.replay.replay import Replay
from neurosnap.sensorium import unpack
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.recorded_runs import (
    TICKS,
    told,
)
from tools.browser import wait_shown, wait_until

pytestmark = IN_BROWSER


def between_classes(hasse: frozenset[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return what implies what, but for what is also implied by it."""

    def above(literal: int) -> set[int]:
        reached, ahead = set[int](), [literal]
        while ahead:
            one = ahead.pop()
            found = {b for a, b in hasse if a == one} - reached
            reached |= found
            ahead += found
        return reached

    return {(a, b) for a, b in hasse if a not in above(b)}


async def test_the_order_and_its_height_are_those_a_replay_derives(
    planner_log: Path,
) -> None:
    truth = told(planner_log)
    async with opened(planner_log) as page:
        for tick in (3, 17, TICKS):
            await go_to(page, tick)
            drawn = await page.evaluate(
                """async () => (await import("/main.js")).page.diagram._drawing.links
                    .flatMap(({ edges }) => edges)
                    .map(({ source, target }) => [source, target])"""
            )
            both = {pair for a, b in drawn for pair in ((a, b), (b ^ 1, a ^ 1))}
            assert both == between_classes(truth[tick].hasse)
            facts = await page.inner_text("#diagram-facts")
            assert facts.endswith(f"height {truth[tick].height}")


async def test_no_two_nodes_overlap_and_what_is_implied_stands_above(
    planner_log: Path,
) -> None:
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
        places, edges = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                const places = diagram._laid.places;
                const of = (item) => places.get(item.key).y;
                return [
                    [...places.values()].map(({ x, y, width }) => [x, y, width]),
                    diagram._drawing.links.filter(({ edges: [{ source, target }] }) =>
                        source % 2 === 0 && target % 2 === 0,
                    ).map(({ from, to }) => [of(from), of(to)]),
                ];
            }"""
        )
    for k, (x, y, width) in enumerate(places):
        for other_x, other_y, other_width in places[:k]:
            aside = abs(x - other_x) >= (width + other_width) / 2
            assert aside or abs(y - other_y) >= 20
    assert edges
    assert all(above < below for below, above in edges)


async def test_whatever_is_equivalent_says_to_what(planner_log: Path) -> None:
    replay = Replay(Recording.open(planner_log))
    for _ in replay.ticks():
        pass
    sensorium = replay.core.snapshot.sensorium
    first, *others = max(replay.core.graph.classes(), key=len)
    assert len(others) > 10
    async with opened(planner_log, f"#t={TICKS}") as page:
        await wait_shown(page, TICKS)
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


async def test_what_is_too_small_to_read_is_named_under_the_pointer(
    large_log: Path,
) -> None:
    async with opened(large_log, "#t=6") as page:
        await wait_shown(page, 6)
        name, place = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                const { name, key } = diagram._drawing.items.at(-1);
                return [name, diagram._camera.over(diagram._laid.places.get(key))];
            }"""
        )
        box = await page.locator("#drawing").bounding_box()
        assert box is not None
        await page.mouse.move(box["x"] + place["x"], box["y"] + place["y"])
        await expect(page.locator("#drawing")).to_have_attribute(
            "title", re.compile(f"^{re.escape(name)}: [1-9]")
        )


async def test_an_edge_that_is_clicked_shows_its_weights(path_log: Path) -> None:
    rows = np.array(
        [
            unpack(each.message.bits, 7)
            for each in Recording.open(path_log).messages(("observe",))
            if isinstance(each.message, wire.Observation)
        ]
    )
    async with opened(path_log, "#t=30") as page:
        await wait_shown(page, 30)
        edge, place = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                const { along } = await import("/order/links.js");
                for (const [link, c] of diagram._curves) {
                    const place = diagram._camera.over(along(c, 0.5));
                    // Not one that passes behind a node there.
                    const found = diagram._at(place.x, place.y);
                    if (found?.link === link) return [link.edges[0], place];
                }
            }"""
        )
        box = await page.locator("#drawing").bounding_box()
        assert box is not None
        await page.mouse.click(box["x"] + place["x"], box["y"] + place["y"])
        for tick in (30, 12):
            await go_to(page, tick)
            await page.wait_for_selector(f'#choice-body[data-tick="{tick}"]')
            seen = await page.locator("#edge td").all_inner_texts()
            a, b = (
                rows[:tick, edge[end] >> 1] ^ bool(edge[end] & 1)
                for end in ("source", "target")
            )
            counts = [a & b, a & ~b, ~a & b, ~a & ~b]
            assert seen[:4] == [str(int(each.sum())) for each in counts]
            assert float(seen[4]) == pytest.approx(0.08 * tick, abs=1e-4)
        await page.wait_for_selector("#choice .uplot canvas")
        await page.keyboard.press("Escape")
        await expect(page.locator("#choice")).to_be_hidden()
        for button in ("right", "middle"):
            x, y = box["x"] + place["x"], box["y"] + place["y"]
            await page.mouse.click(x, y, button=button)
            await expect(page.locator("#choice")).to_be_hidden()


async def test_five_hundred_sensors_collapse_and_open(large_log: Path) -> None:
    names = options_of(Recording.open(large_log)).sensors
    async with opened(large_log, "#t=6") as page:
        await wait_shown(page, 6)
        drawing = page.locator("#drawing")
        few = int(await drawing.get_attribute("data-items") or "0")
        assert 0 < few <= 160
        sensor, place = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                const { items } = diagram._drawing;
                const { key, sensors } = items.find(({ kind }) => kind !== "sensor");
                const place = diagram._laid.places.get(key);
                return [sensors[0], diagram._camera.over(place)];
            }"""
        )
        box = await drawing.bounding_box()
        assert box is not None
        await page.mouse.click(box["x"] + place["x"], box["y"] + place["y"])
        await wait_until(
            page, f"document.querySelector('#drawing').dataset.items > {few}"
        )
        await page.fill("#search-text", names[sensor])
        await page.press("#search-text", "Enter")
        await expect(page.locator("#choice-title")).to_have_text(names[sensor])
        await page.click("#expand")
        await expect(drawing).to_have_attribute("data-items", "500")
        await page.click("#expand")
        await expect(drawing).to_have_attribute("data-items", str(few))


async def test_what_is_shown_already_is_not_painted_again(path_log: Path) -> None:
    async with opened(path_log, "#t=20") as page:
        for tick in (20, 3):  # both orders are known from then on
            await go_to(page, tick)
        painted = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const { diagram, player } = page;
                let [nodes, shown] = [0, 0];
                const { paint } = diagram._painter;
                diagram._painter.paint = function (...given) {
                    nodes += 1;
                    paint.apply(this, given);
                };
                const show = diagram.show;
                diagram.show = function (...given) {
                    shown += 1;
                    show.apply(this, given);
                };
                player.seek(20);
                for (let k = 0; k < 3; k += 1) page.move();
                return [nodes, shown];
            }"""
        )
    assert painted == [7, 1]
