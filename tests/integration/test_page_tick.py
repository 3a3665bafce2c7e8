"""What the page shows of one tick: its state, waves, plans, descriptions and images."""

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.depth.measure import from_recording
from neurosnap.recording.read.recording import Recording
from tests.support.aliased_worlds import RING
from tests.support.browser_pages import (
    IN_BROWSER,
    go_to,
    opened,
    page_at,
    shown_tick,
    states,
    worded,
)
from tests.support.lamp import BIRTH, GROWN
from tests.support.recorded_runs import TICKS, recorded
from tests.support.run_options import options_for
from tools.browser import wait_shown

pytestmark = IN_BROWSER
GOAL = "x_below_1"  # the first literal of what the planner wants
SCENES = 60  # ticks in the world of the lamp
PLANNED = 36  # a plan of two steps begins, and nothing gets in its way
LAKE = "neurosnap/FrozenLake-v0"
SIGNS = {"contradicted": "!", "unknown": "?"}
IMAGES = 20  # ticks of the run that records images
EVERY = 6


async def test_a_wave_goes_hop_by_hop(planner_log: Path) -> None:
    view = RunView(planner_log)
    waves = (
        (wave.depth, frame.tick, wave)
        for frame in view.frames(1, TICKS)
        for wave in frame.waves
        if wave.kind != "state"
    )
    depth, tick, wave = max(waves, key=lambda found: found[:2])
    assert depth >= 2
    assert wave.hops is not None
    first, names = wave.signal[0], view.options.sensors
    page = await page_at(planner_log, tick)
    await page.select_option("#wave-which", names[first >> 1] + "*" * (first & 1))
    assert await page.get_attribute("#wave-hop", "max") == str(depth)
    for hop in range(depth + 1):
        await page.fill("#wave-hop", str(hop))
        there = sum(at <= hop for _, at in wave.hops)
        says = f"Hop {hop} of {depth}: {there} of {len(wave.hops)} literals reached"
        await expect(page.locator("#wave-says")).to_contain_text(says)
    await page.focus("#wave-hop")  # the slider goes to its own ends, not to the run's
    for key, end in (("Home", 0), ("End", depth)):
        await page.keyboard.press(key)
        assert await page.input_value("#wave-hop") == str(end)
        assert await shown_tick(page) == tick
    await page.click("#wave-play")  # back to the state
    await page.keyboard.press("Escape")
    await page.press("body", "w")
    await expect(page.locator("#wave-says")).to_contain_text(f"Hop {depth} of {depth}")


@pytest.mark.slow
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


@pytest.mark.slow
async def test_the_world_is_drawn_with_its_target_and_place(planner_log: Path) -> None:
    run_view = RunView(planner_log)
    stage = run_view.scene.stage
    assert stage is not None
    assert stage.target is not None
    target = f"({', '.join(map(str, stage.coordinates[stage.target]))})"
    page = await page_at(planner_log, 1)
    world = page.locator("#world svg")
    assert await world.locator("rect").count() == 9
    assert await world.locator("circle.target").count() == 2  # a ring in a ring
    agent = world.locator("circle.agent")
    begins = page.locator("#now-begins")
    for frame in run_view.frames(1, 12):
        await go_to(page, frame.tick)
        assert frame.place is not None
        x, y = stage.coordinates[frame.place]
        place = f"({x}, {y})"
        said = f"A grid of 9 places: at {place}, target {target}"
        steps = [] if frame.plan is None else frame.plan.steps
        there, visits = frame.place, dict[int, list[str]]()
        for number, step in enumerate(steps, 1):
            there = stage.moves[step][there]
            visits.setdefault(there, []).append(str(number))
        dots = world.locator(".plan-steps text")
        await expect(dots).to_have_text([" ".join(each) for each in visits.values()])
        label = re.compile(
            re.escape(said) + ("; steps of the plan: 1" if steps else "$")
        )
        await expect(world).to_have_attribute("aria-label", label)
        await expect(agent).to_have_attribute("cx", f"{x + 0.5}")
        assert await begins.is_visible() == frame.begins


async def test_what_was_not_read_and_what_is_contradicted_is_said_and_drawn(
    unread_log: Path,
) -> None:
    truth = worded(unread_log)
    # At 31 only the first sensor is read, at 32 what is read breaks the rule.
    assert truth[31] == ["on", "on", "unknown"]
    assert truth[32] == ["contradicted", "contradicted", "unknown"]
    async with opened(unread_log, "#t=30") as page:
        await page.click("#tab-sensors")
        for tick, reads, unread, contradicted, why, changed in [
            (30, ["on", "on", "on"], "none", "nothing", ["read"] * 3, ""),
            (
                31,
                ["on", "unknown", "unknown"],
                "s1, s2",
                "nothing",
                ["read", "predicted: not read; s0 says on", "unknown"],
                ": s2 unknown",
            ),
            (
                32,
                ["on", "off", "unknown"],
                "s2",
                "s0, s1",
                [
                    "contradicted: reads on; s1* says off",
                    "contradicted: reads off; s0 says on",
                    "unknown",
                ],
                ": s0 contradicted, s1 contradicted",
            ),
        ]:
            await go_to(page, tick)
            assert await states(page, tick) == truth[tick]
            assert await page.locator("#outline td.reads").all_inner_texts() == reads
            beliefs = page.locator("#outline td.belief")
            assert await beliefs.all_inner_texts() == why
            facts = page.locator("#now dd")
            assert await facts.nth(0).inner_text() == contradicted
            assert await facts.nth(1).inner_text() == unread
            drawn = page.locator("#drawing .node")
            for sensor, word in enumerate(truth[tick]):
                await expect(drawn.nth(sensor)).to_have_class(
                    re.compile(rf"\b{word}\b")
                )
            # Told apart without colour, too: by the sign at their ends.
            signs = [SIGNS.get(word, "∗") for word in truth[tick]]
            assert await drawn.locator(".sign").all_text_contents() == signs
            await expect(page.locator("#said")).to_have_text(f"tick {tick}{changed}")
        await page.locator("#drawing [data-sensor='1']").hover()
        await expect(page.locator("#drawing")).to_have_attribute(
            "title", "s1: reads off; s0 says on"
        )
        await page.locator("#outline tbody button").nth(2).click()
        has = page.locator("#choice-body dd")
        assert await has.nth(0).inner_text() == "unknown"
        assert await has.nth(1).inner_text() == "unknown"


@pytest.mark.slow
async def test_a_sensor_says_what_would_follow_if_it_were_on_or_off(
    planner_log: Path,
) -> None:
    view = RunView(planner_log)
    graph = view.learned(TICKS).snapshot.poc_graph()
    page = await page_at(planner_log, TICKS)
    told = await page.evaluate(
        """async () => {
            const { consequences } = await import("/tick/belief.js");
            const { page } = await import("/main.js");
            const ids = [...Array(2 * page.names.length).keys()];
            const far = page.names.map((_, sensor) => `s${sensor}`);
            return ids.map((literal) => consequences(literal, page.order.graph, far));
        }"""
    )
    for literal, words in enumerate(told):
        above = graph.up([literal])
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


@pytest.mark.slow
async def test_two_that_exclude_each_other_say_so_both(planner_log: Path) -> None:
    view = RunView(planner_log)
    names = view.options.sensors
    page = await page_at(planner_log, TICKS)
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


@pytest.mark.slow
async def test_what_was_learned_in_a_range_is_one_click_away(planner_log: Path) -> None:
    async with opened(planner_log, "#t=3&range=5-20") as page:
        await page.click("#range-compare")
        await wait_shown(page, 20)
        await expect(page.locator("#tab-compare")).to_be_focused()
        heads = page.locator("#compare .differences thead th")
        await expect(heads.nth(0)).to_have_text("tick 20")
        await expect(heads.nth(1)).to_have_text("tick 5")
        # However long the lists beside it are, its rows stand together.
        table = page.locator("#compare .differences > table")
        assert await table.locator("tbody tr").count() == 3
        box: Any = await table.bounding_box()
        assert box["height"] < 120
        await page.keyboard.press("x")
        await expect(page.locator("#range-compare")).to_be_hidden()


@pytest.mark.slow
async def test_a_wave_that_goes_nowhere_does_not_hide_the_state(
    path_log: Path, unread_log: Path
) -> None:
    shown = """async () => {
        const { page } = await import("/main.js");
        page.wave.run(0.5);
        return page.wave.shown !== null;
    }"""
    page = await page_at(path_log, 9)
    assert not await page.evaluate(shown)
    page = await page_at(unread_log, 31)  # a sensor is predicted
    await wait_shown(page, 31)
    assert await page.evaluate(shown)


async def test_a_sensor_is_drawn_and_listed_from_its_birth_on(lamp_log: Path) -> None:
    page = await page_at(lamp_log, BIRTH - 1)
    facts = page.locator("#diagram-facts")
    await expect(facts).to_contain_text("24 sensors,")
    await expect(page.locator("#what")).to_contain_text(
        "24 sensors, 1 grown, room for 2 more"
    )
    await page.click("#tab-sensors")
    rows = page.locator("#outline tbody tr:visible")
    await expect(rows).to_have_count(24)
    await go_to(page, BIRTH)
    await expect(facts).to_contain_text("25 sensors,")
    await expect(rows).to_have_count(25)
    await expect(rows.last.locator("th")).to_have_text(GROWN)
    await expect(page.locator("#now")).to_contain_text(f"grew {GROWN}")
    await expect(page.locator("#said")).to_contain_text(f"grew {GROWN}")
    await rows.last.locator("button").click()
    await expect(page.locator("#choice-title")).to_have_text(GROWN)
    await go_to(page, 5)
    await expect(page.locator("#choice-body")).to_contain_text("not grown yet")
    for text, found in (("grown", "none"), (GROWN, "1 found")):
        await page.fill("#search-text", text)
        await expect(page.locator("#search-found")).to_have_text(found)


@pytest.mark.slow
async def test_one_goes_to_a_birth_by_the_keyboard(lamp_log: Path) -> None:
    page = await page_at(lamp_log, 3)
    mark = page.locator("#strip .born")
    await expect(mark).to_have_count(1)
    await page.focus("#tab-plots")
    for tab in ("raster", "sensors", "grown"):
        await page.keyboard.press("ArrowRight")
        await expect(page.locator(f"#tab-{tab}")).to_be_focused()
    row = page.locator("#grown-list tbody tr")
    await expect(row).to_contain_text(f"{BIRTH} ticks")
    await row.locator("td button").focus()
    await page.keyboard.press("Enter")
    await wait_shown(page, BIRTH)
    await row.locator("th button").focus()
    await page.keyboard.press("Enter")
    await expect(page.locator("#choice-title")).to_have_text(GROWN)


@pytest.fixture(scope="module")
def ring_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    given: dict[str, Any] = {"grow": 30, "imagine": 30, "explore": "planned"}
    options = options_for(
        *(RING, 1, {"places": 6}), agent="planner", ticks=330, target=(), **given
    )
    return recorded(options, tmp_path_factory.mktemp("ring") / "run.mcap")


@pytest.mark.slow
async def test_what_is_never_read_is_said_to_be_believed_and_why(
    ring_log: Path,
) -> None:
    page = await page_at(ring_log, 330)
    await page.click("#tab-grown")
    ways = "one place of 6, with ~beacon_0&~beacon_3; left leads here from @"
    await expect(page.locator("#grown-list")).to_contain_text(ways)
    await page.locator("#grown-list th button", has_text="@").last.click()
    believed = re.compile(r"never read, believed (on|off): one place of 6, with ")
    await expect(page.locator("#choice-body")).to_contain_text(believed)


@pytest.mark.slow
async def test_an_imagined_wave_is_told_apart_and_the_plan_is_shown(
    lamp_log: Path,
) -> None:
    async with opened(lamp_log, f"#t={PLANNED}", still=True) as page:
        which = page.locator("#wave-which")
        here = await which.locator("> option").all_inner_texts()
        assert here == [
            "state",
            *(f"consequences of {action}" for action in ("turn_a", "turn_b", "press")),
        ]
        ahead = await which.locator("optgroup option").all_inner_texts()
        name = next(one for one in ahead if one.startswith("imagined: press, wave "))
        label = page.locator("#drawing-wave")
        await expect(label).to_be_hidden()
        await page.click("#wave-play")
        await expect(label).to_have_text("state")
        # Whose system wants no motion gets it at its end.
        most = await page.get_attribute("#wave-hop", "max")
        assert await page.input_value("#wave-hop") == most
        await which.select_option(name.removeprefix("imagined: "))
        await expect(label).to_have_text(name)
        await expect(label).to_have_class("imagined")
        says = page.locator("#wave-says")
        await expect(says).to_contain_text(f"I{name[1:]}. Hop")
        await expect(says).not_to_contain_text("of 0 literals")  # its hops came
        steps = page.locator(".plan li")
        await expect(steps).to_have_text(["turn_a", "turn_b"])
        await expect(steps.first).to_have_attribute("aria-current", "step")
        await expect(page.locator(".plan")).to_have_attribute(
            "aria-label", "Plan: 2 steps to go"
        )
        await expect(page.locator("#now")).to_contain_text("to test what turn_b does")
        await go_to(page, PLANNED + 1)
        await expect(steps).to_have_text(["turn_b"])


@pytest.mark.slow
async def test_a_page_of_a_run_that_grows_nothing_has_none_of_it(
    path_log: Path,
) -> None:
    page = await page_at(path_log, 3)
    for what in ("#tab-grown", "#grown", ".plan"):
        await expect(page.locator(what)).to_have_count(0)
    await expect(page.locator("#now")).not_to_contain_text("grown")


@pytest.fixture(scope="module")
def lake_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = options_for(LAKE, 5, ticks=IMAGES, cells="inline", frames=EVERY)
    return recorded(options, tmp_path_factory.mktemp("lake") / "run.mcap")


@pytest.mark.slow
async def test_the_latest_image_is_shown_with_its_tick(lake_log: Path) -> None:
    view = RunView(lake_log)
    async with opened(lake_log, but_for="status of 500") as page:
        shown = page.locator("#image-drawing")
        # Back and forth: what is shown follows from the tick alone.
        for tick in (1, 6, 20, 2):
            await go_to(page, tick)
            of = tick - (tick - 1) % EVERY
            await expect(page.locator("#image-tick")).to_have_text(f"tick {of}")
            said = f"The environment at tick {of}, as it draws itself."
            await expect(shown).to_have_attribute("alt", said)
            await expect(shown).to_be_visible()
            content = await page.evaluate(
                """async () => {
                    const image = document.querySelector("#image-drawing");
                    await image.decode();
                    const answer = await fetch(image.src);
                    return [...new Uint8Array(await answer.arrayBuffer())];
                }"""
            )
            image = view.image(of)
            assert image is not None
            assert (image.tick, image.data) == (of, bytes(content))
        await page.route("**/api/image?tick=7", lambda route: route.fulfill(status=500))
        await go_to(page, 8)
        said = "the image of tick 7 cannot be had"
        await expect(page.locator("#image-tick")).to_have_text(said)
        await expect(shown).to_be_hidden()


@pytest.mark.slow
async def test_a_word_is_explained_by_pointer_keyboard_and_touch(
    planner_log: Path,
) -> None:
    page = await page_at(planner_log, 30)
    tip = page.locator("#tip")
    height = page.locator("#now .term", has_text="height")
    await height.hover()
    await expect(tip).to_contain_text("longest chain of implications")
    await tip.hover()  # one may read it at leisure
    await expect(tip).to_be_visible()
    await page.mouse.move(400, 400)
    await expect(tip).to_be_hidden()
    await height.focus()
    await expect(tip).to_be_visible()
    assert await height.get_attribute("aria-describedby") == "tip"
    await page.keyboard.press("Escape")
    await expect(tip).to_be_hidden()


@pytest.mark.slow
async def test_every_word_that_is_marked_is_explained(planner_log: Path) -> None:
    page = await page_at(planner_log, 30)
    await page.click("#tab-sensors")
    await page.locator("#outline th[scope=row] button").first.click()
    await page.locator("#choice .edges button").first.click()
    await page.wait_for_selector("#choice .term")
    marked = await page.locator(".term").evaluate_all(
        "(all) => all.map((one) => one.dataset.term)"
    )
    await page.click("#help")
    known = await page.locator("#words-list dt").all_inner_texts()
    assert len(set(marked)) > 20
    assert set(marked) <= set(known)


@pytest.mark.slow
async def test_sensors_are_found_by_what_is_believed_and_read(unread_log: Path) -> None:
    page = await page_at(unread_log, 31)
    for asked, found in {
        "is:predicted": ["s1"],
        "is:on": ["s0", "s1"],
        "is:unknown": ["s2"],
        "reads:unknown": ["s1", "s2"],
        "reads:unknown is:on": ["s1"],
        "s2 is:on": [],
    }.items():
        await page.fill("#search-text", asked)
        said = f"{len(found)} found" if found else "none"
        await expect(page.locator("#search-found")).to_have_text(said)
        for name in found:
            await page.press("#search-text", "Enter")
            await expect(page.locator("#choice-title")).to_have_text(name)
    await page.fill("#search-text", "is:warm")
    await expect(page.locator("#search-found")).to_contain_text("is: one of on, off")


async def test_depths_of_all_waves_are_dots_and_a_click_plays_one(
    planner_log: Path,
) -> None:
    rows = Counter(
        (row.kind, row.height, row.depth)
        for row in from_recording(Recording.open(planner_log))
    )
    page = await page_at(planner_log, 1)
    dots = page.locator("#depths-dots rect")
    await expect(dots).to_have_count(len(rows))
    words = [await dot.get_attribute("aria-label") or "" for dot in await dots.all()]
    found = [tuple(map(int, re.findall(r"\d+", each))) for each in words]
    assert sorted(found) == sorted((*pair, n) for (_, *pair), n in rows.items())
    deepest = max(range(len(found)), key=lambda k: found[k][1])
    height, depth, _ = found[deepest]
    await dots.first.focus()
    for _ in range(deepest):
        await page.keyboard.press("ArrowRight")
    await page.keyboard.press("Enter")
    await expect(page.locator("#wave-hop")).to_have_attribute("max", str(depth))
    await expect(page.locator("#wave-play")).to_have_text("Show state")
    await expect(page.locator("#diagram-facts")).to_contain_text(f"height {height}")
    ring, dot = page.locator("#depths-ring"), dots.nth(deepest)
    boxes = [await one.bounding_box() for one in (ring, dot)]
    middles = [(b["x"] + b["width"] / 2, b["y"] + b["height"] / 2) for b in boxes if b]
    assert middles[0] == pytest.approx(middles[1], abs=0.5)


@pytest.mark.slow
async def test_a_tick_without_a_decision_is_not_said_to_do_nothing(
    path_log: Path, csv_log: Path
) -> None:
    last = RunView(path_log).last
    page = await page_at(path_log, last - 1)
    did = page.locator("#now dd").first
    await expect(did).not_to_contain_text("no decision")
    await go_to(page, last)  # where the run ended
    await expect(did).to_have_text(re.compile("^no decision"))
    page = await page_at(csv_log, 9)
    facts = await page.locator("#now dt").all_inner_texts()
    assert "did" not in facts  # nobody decides anything
    assert "why" not in facts


@pytest.mark.slow
async def test_a_state_wave_that_goes_nowhere_says_why(planner_log: Path) -> None:
    page = await page_at(planner_log, TICKS - 1)
    why = "All 40 sensors were read: nothing to infer."
    await expect(page.locator("#wave-why")).to_have_text(why)
    await page.select_option("#wave-which", index=1)
    await expect(page.locator("#wave-why")).to_be_hidden()


@pytest.mark.slow
async def test_edges_are_listed_by_what_they_say(planner_log: Path) -> None:
    page = await page_at(planner_log, TICKS)
    edges = RunView(planner_log).graph(TICKS).edges
    ends = Counter(end >> 1 for one in edges for end in (one.source, one.target))
    ((sensor, count),) = ends.most_common(1)
    await page.click("#tab-sensors")
    await page.locator("#outline tbody button").nth(sensor).click()
    titles = await page.locator("#choice h3").all_inner_texts()
    counts = [int(title.rpartition(" ")[2]) for title in titles]
    assert sum(counts) == count
    known = ("implies", "implied by", "excludes", "one of the two is on")
    assert {title.rpartition(" ")[0] for title in titles} <= set(known)
    for more in await page.locator("#choice button", has_text="Show all").all():
        await more.click()
    assert await page.locator("#choice .edges button").count() == count
