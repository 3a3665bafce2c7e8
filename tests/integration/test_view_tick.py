"""What the page of `neurosnap view` says of a tick is what a replay derives.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

import random
import re
from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap import wire
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of
from tests.support.browser_pages import IN_BROWSER, derived, go_to, opened, states
from tests.support.recorded_runs import (
    TICKS,
)
from tools.browser import wait_shown

pytestmark = IN_BROWSER

GOAL = "x_below_1"  # the first literal of what the planner wants


@pytest.mark.parametrize("name", ["csv", "planner"])
async def test_the_slider_restores_what_a_replay_derives(
    name: str, csv_log: Path, planner_log: Path
) -> None:
    log = {"csv": csv_log, "planner": planner_log}[name]
    truth = derived(log)
    if name == "csv":
        assert "contradicted" in {word for words in truth.values() for word in words}
    chosen = [1, 2, 13, 24, 25, 26, TICKS]
    random.Random(1).shuffle(chosen)
    async with opened(log) as page:
        await page.click("#tab-sensors")
        for tick in chosen:
            await go_to(page, tick)
            assert await states(page, tick) == truth[tick]


async def test_a_wave_goes_hop_by_hop(planner_log: Path) -> None:
    log = Recording.open(planner_log)
    hops: dict[int, list[int]] = {}
    deepest = (0, 0)  # depth, wave
    ticks = {}
    for each in log.messages(("wave", "settle", "reach")):
        match each.message:
            case wire.WaveStart(wave=wave, tick=tick, signal=signal) if signal:
                hops[wave], ticks[wave] = [], (tick, signal[0])
            case wire.CellReport(wave=wave, hops=reached) if wave in hops:
                hops[wave] += reached
            case wire.Reached(wave=wave, depth=depth):
                deepest = max(deepest, (depth, wave))
            case _:
                pass
    depth, wave = deepest
    assert depth >= 2
    tick, first = ticks[wave]
    names = options_of(log).sensors
    async with opened(planner_log, f"#t={tick}") as page:
        await wait_shown(page, tick)
        await page.select_option("#wave-which", names[first >> 1] + "*" * (first & 1))
        assert await page.get_attribute("#wave-hop", "max") == str(depth)
        for hop in range(depth + 1):
            await page.fill("#wave-hop", str(hop))
            there = sum(at <= hop for at in hops[wave])
            says = (
                f"Hop {hop} of {depth}: {there} of {len(hops[wave])} literals reached"
            )
            await expect(page.locator("#wave-says")).to_contain_text(says)
        await page.click("#wave-play")  # back to the state
        await page.keyboard.press("Escape")
        await page.press("body", "w")
        await expect(page.locator("#wave-says")).to_contain_text(
            f"Hop {depth} of {depth}"
        )


async def test_who_wants_no_motion_gets_the_wave_at_its_end(planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}", still=True) as page:
        await wait_shown(page, TICKS)
        await page.select_option("#wave-which", GOAL)
        await page.press("body", "w")
        depth = await page.get_attribute("#wave-hop", "max")
        assert await page.input_value("#wave-hop") == depth
        assert not await page.evaluate(
            """async () => (await import("/main.js")).page.wave._started !== null"""
        )


async def test_a_wave_that_is_not_there_still_has_a_name(planner_log: Path) -> None:
    async with opened(planner_log, "#t=1") as page:
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                page.wave.show({ ...page.frame, waves: [] });
            }"""
        )
        option = page.locator("#wave-which option")
        await expect(option).to_have_text("state: not at this tick")


async def test_the_world_is_drawn_with_its_target_and_place(planner_log: Path) -> None:
    run_view = RunView(planner_log)
    stage = run_view.scene.stage
    assert stage is not None
    assert stage.target is not None
    target = f"({', '.join(map(str, stage.coordinates[stage.target]))})"
    async with opened(planner_log) as page:
        world = page.locator("#world svg")
        assert await world.locator("rect").count() == 9
        assert await world.locator("circle.target").count() == 2  # a ring in a ring
        agent = world.locator("circle.agent")
        for frame in run_view.frames(1, TICKS):
            await go_to(page, frame.tick)
            assert frame.place is not None
            x, y = stage.coordinates[frame.place]
            place = f"({x}, {y})"
            said = f"A grid of 9 places: at {place}, target {target}"
            await expect(world).to_have_attribute("aria-label", said)
            await expect(agent).to_have_attribute("cx", f"{x + 0.5}")


async def test_the_cells_are_those_that_sent_something(path_log: Path) -> None:
    sent: dict[str, int] = {}
    for each in Recording.open(path_log).messages():
        sender = each.message.sender
        sent[sender] = sent.get(sender, 0) + 1
    async with opened(path_log) as page:
        await page.click("#tab-cells")
        await page.wait_for_selector("#cells tbody tr")
        rows = await page.locator("#cells tbody tr").all_inner_texts()
        seen = {row.split("\t")[0]: int(row.split("\t")[2]) for row in rows}
        assert seen == sent


async def test_what_was_not_read_and_what_is_contradicted_is_said_and_drawn(
    unread_log: Path,
) -> None:
    truth = derived(unread_log)
    # At 31 only the first sensor is read, at 32 what is read breaks the rule.
    assert truth[31] == ["on", "on", "unknown"]
    assert truth[32] == ["contradicted", "contradicted", "unknown"]
    async with opened(unread_log, "#t=30") as page:
        await page.click("#tab-sensors")
        for tick, reads, unread, contradicted, changed in [
            (30, ["on", "on", "on"], "none", "nothing", ""),
            (31, ["on", "unknown", "unknown"], "s1, s2", "nothing", ": s2 unknown"),
            (
                32,
                ["on", "off", "unknown"],
                "s2",
                "s0, s1",
                ": s0 contradicted, s1 contradicted",
            ),
        ]:
            await go_to(page, tick)
            assert await states(page, tick) == truth[tick]
            assert await page.locator("#outline td.reads").all_inner_texts() == reads
            facts = page.locator("#now dd")
            assert await facts.nth(0).inner_text() == contradicted
            assert await facts.nth(1).inner_text() == unread
            drawn = await page.evaluate(
                """async () => {
                    const { diagram } = (await import("/main.js")).page;
                    return [0, 1, 2].map((sensor) =>
                        diagram._shown.get(`s${sensor}`).split(",")[0]);
                }"""
            )
            assert drawn == truth[tick]
            await expect(page.locator("#said")).to_have_text(f"tick {tick}{changed}")
        await page.locator("#outline tbody button").nth(2).click()
        has = page.locator("#choice-body dd")
        assert await has.nth(0).inner_text() == "unknown"
        assert await has.nth(1).inner_text() == "unknown"


async def test_unknown_and_contradicted_are_told_apart_without_colour(
    unread_log: Path,
) -> None:
    async with opened(unread_log, "#t=32") as page:
        await wait_shown(page, 32)
        signs = await page.evaluate(
            """async () => {
                const { NodePainter } = await import("/order/nodes.js");
                const context = document.createElement("canvas").getContext("2d");
                const item = { kind: "sensor", name: "s", sensors: [0] };
                const place = { x: 50, y: 50, width: 60, item };
                return ["on", "off", "unknown", "contradicted"].map((condition) => {
                    const said = [];
                    context.fillText = (text) => said.push(text);
                    context.setLineDash = (dash) => said.push(dash.length);
                    const look = { condition, own: 0, complement: 0, share: [] };
                    new NodePainter().paint(context, place, look, 1);
                    return said;
                });
            }"""
        )
    # How the border is drawn, solid again, the name, and the sign at its end.
    assert signs == [
        [0, 0, "s", "∗"],
        [0, 0, "s", "∗"],
        [2, 0, "s", "?"],
        [0, 0, "s", "!"],
    ]


async def test_a_plot_says_what_its_columns_are_at_the_tick(planner_log: Path) -> None:
    run_view = RunView(planner_log)
    (frame,) = run_view.frames(TICKS, TICKS)
    far = run_view.scene.distance(frame.place)
    async with opened(planner_log, f"#t={TICKS}") as page:
        captions = page.locator("#plots figcaption")
        await expect(captions).to_have_text(
            [
                f"Edges {frame.edges} ",
                re.compile(r"^Err \d+ $"),
                f"Depth {frame.depth} Longest {frame.longest} Height {frame.height} ",
                f"Pulses a tick {frame.pulses} ",
                f"On {frame.state.count(1)} Predicted 0 Contradicted 0 Unknown 0 ",
                f"Distance to target {far:.0f} ",
            ]
        )
