"""The page of `neurosnap view` in a real browser shows what a replay derives.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest
from playwright.async_api import ConsoleMessage, Page, expect

from neurosnap import wire
from neurosnap.agent.context import Body
from neurosnap.record.reader import Recording
from neurosnap.record.replay import Replay, options_of
from neurosnap.sensorium import unpack
from neurosnap.view.desk import Desk
from neurosnap.view.server import serving
from tests.unit.view.films import (
    TICKS,
    csv_run,
    in_chunks,
    path_run,
    planner_run,
    recorded,
    told,
)
from tools.screenshots import (
    SIZE,
    Scheme,
    browsing,
    chromium,
    shoot,
    wait_shown,
    wait_until,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(90),
    pytest.mark.skipif(chromium() is None, reason="there is no Chromium to look with"),
]

AXE = Path(__file__).parents[1] / "vendor" / "axe-core" / "axe.min.js"
GOAL = "x_below_1"  # the first literal of what the planner wants
schemes = pytest.mark.parametrize("scheme", ["light", "dark"])


@pytest.fixture(scope="module")
def path_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "path.mcap")


@pytest.fixture(scope="module")
def planner_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(planner_run(), tmp_path_factory.mktemp("planner") / "planner.mcap")


@pytest.fixture(scope="module")
def csv_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("csv")
    return recorded(csv_run(folder / "readings.csv"), folder / "csv.mcap")


@pytest.fixture(scope="module")
def large_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of twenty chains of 25 sensors each."""
    folder = tmp_path_factory.mktemp("large")
    chance = random.Random(4)
    names = [f"c{chain}_below_{k}" for chain in range(20) for k in range(25)]
    lines = [",".join(names)]
    for _ in range(6):
        places = [chance.randrange(26) for _ in range(20)]
        lines.append(",".join(f"{x <= k:d}" for x in places for k in range(25)))
    readings = folder / "readings.csv"
    readings.write_text("\n".join(lines) + "\n", encoding="utf-8")
    options = msgspec.structs.replace(
        path_run(6), source=str(readings), arguments={}, body=Body(own=tuple(names))
    )
    return recorded(options, folder / "large.mcap")


@asynccontextmanager
async def opened(
    log: Path,
    where: str = "",
    scheme: Scheme = "light",
    *,
    grows: Callable[[], bool] = lambda: False,
    still: bool = False,
) -> AsyncIterator[Page]:
    """Serve a recording and look at it until the page shows a tick."""
    strange: list[str] = []

    def on_console(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            strange.append(message.text)

    async with (
        serving(Desk(log, grows)) as address,
        browsing(scheme, still=still) as page,
    ):
        home = f"http://127.0.0.1:{address.port}/"

        def on_address(url: str) -> None:
            if not url.startswith(home):
                strange.append(url)

        page.on("console", on_console)
        page.on("pageerror", lambda error: strange.append(str(error)))
        page.on("request", lambda request: on_address(request.url))
        page.on("websocket", lambda socket: on_address(socket.url))
        await page.goto(address.url + where)
        await page.wait_for_selector("#drawing[data-tick]", state="attached")
        yield page
    assert strange == []


async def go_to(page: Page, tick: int) -> None:
    await page.fill("#time", str(tick))
    await wait_shown(page, tick)


async def shown_tick(page: Page) -> int:
    return int(await page.get_attribute("#drawing", "data-tick") or "0")


async def states(page: Page, tick: int) -> list[str]:
    """Return what the table in words says of every sensor at a tick."""
    await page.wait_for_selector(f'#outline[data-tick="{tick}"]', state="attached")
    return await page.locator("#outline td.state").all_inner_texts()


def derived(log: Path) -> dict[int, list[str]]:
    """Return what a replay says of every sensor, tick by tick, in the page's words."""
    recording = Recording.open(log)
    observed = {
        each.message.tick: each.message.bits
        for each in recording.messages(("observe",))
        if isinstance(each.message, wire.Observation)
    }
    replay = Replay(recording)
    found = {}
    for tick in replay.ticks():
        state = replay.core.snapshot.state.reshape(-1, 2)
        bits = unpack(observed[tick], len(state))
        above = replay.core.graph.up(np.stack([bits, ~bits], axis=1).ravel())
        neither = np.where(above.reshape(-1, 2).all(axis=1), "contradicted", "unknown")
        found[tick] = [
            "on" if on else "off" if off else str(other)
            for (on, off), other in zip(state.tolist(), neither, strict=True)
        ]
    return found


# What is shown ------------------------------------------------------------------------


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


async def test_the_order_and_its_height_are_those_a_replay_derives(
    planner_log: Path,
) -> None:
    truth = told(planner_log)
    async with opened(planner_log) as page:
        for tick in (3, 17, TICKS):
            await go_to(page, tick)
            drawn = await page.evaluate(
                """async () => (await import("/main.js")).page.diagram._graph.edges
                    .map(({ source, target }) => [source, target])"""
            )
            both = {pair for a, b in drawn for pair in ((a, b), (b ^ 1, a ^ 1))}
            assert both <= truth[tick].hasse
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
                for (const link of diagram._drawing.links) {
                    const [edge] = link.edges;
                    const place = diagram.whereIs({ edge });
                    // Not one that passes behind a node there.
                    if (diagram._at(place.x, place.y)?.link === link) return [edge, place];
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


async def test_a_wave_goes_hop_by_hop(planner_log: Path) -> None:
    log = Recording.open(planner_log)
    hops: dict[int, list[int]] = {}
    deepest = (0, 0)  # depth, wave
    ticks = {}
    for each in log.messages(("wave", "settle", "reach")):
        match each.message:
            case wire.WaveStart(wave=wave, tick=tick, signal=signal) if signal:
                hops[wave], ticks[wave] = [], (tick, signal[0])
            case wire.Settled(wave=wave, hops=reached) if wave in hops:
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


async def test_the_world_is_drawn_with_its_target_and_place(planner_log: Path) -> None:
    async with opened(planner_log) as page:
        world = page.locator("#world svg")
        assert await world.locator("rect").count() == 9
        label = await world.get_attribute("aria-label")
        assert label is not None
        assert label.startswith("A grid of 9 places: at (")


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


# Moving -------------------------------------------------------------------------------


async def test_playing_goes_on_and_stops_at_the_end(path_log: Path) -> None:
    truth = derived(path_log)
    async with opened(path_log, "#t=20") as page:
        await page.click("#tab-sensors")
        play = page.locator("#play")
        await page.select_option("#speed", "20")
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
        await play.click()
        await wait_shown(page, TICKS)
        await expect(play).to_have_attribute("aria-label", "Play")
        await page.click("#start")
        await wait_shown(page, 1)


async def test_it_plays_as_fast_as_it_was_told(path_log: Path) -> None:
    async with opened(path_log) as page:
        gone = await page.evaluate(
            """async () => {
                const { Player, SPEEDS } = await import("/player.js");
                const gone = [];
                for (const speed of SPEEDS) {
                    const on = { ready: () => true, move() {}, change() {} };
                    const player = new Player(on);
                    player.setRange(1, 1000);
                    player.setSpeed(speed);
                    player.play();
                    const began = player._before;
                    for (let k = 1; k <= 20; k += 1) player._advance(began + 100 * k);
                    gone.push([speed, player.position - 1]);
                    player.pause();
                }
                return gone;
            }"""
        )
    assert len(gone) == 8
    for speed, ticks in gone:
        assert ticks == pytest.approx(2 * speed)


async def test_a_plot_that_is_clicked_leads_there(path_log: Path) -> None:
    async with opened(path_log) as page:
        await page.wait_for_selector("#plots .u-over")
        over = page.locator("#plots .u-over").first
        box = await over.bounding_box()
        assert box is not None
        await over.click(position={"x": box["width"] - 2, "y": 20})
        await wait_shown(page, TICKS)


async def test_the_address_holds_the_tick(path_log: Path) -> None:
    async with opened(path_log, "#t=17") as page:
        await wait_shown(page, 17)
        await page.evaluate("location.hash = 't=9'")
        await wait_shown(page, 9)
        await go_to(page, 21)
        assert page.url.endswith("/#t=21")


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
        await keys.press("ArrowRight")  # a slider's own step, and not one more of ours
        await wait_shown(page, 2)
        label = await page.get_attribute("#time", "aria-valuetext")
        assert label == f"tick 2 of {TICKS}"
        await page.focus("body")
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
        await page.focus("#tab-plots")
        await keys.press("ArrowRight")
        await expect(page.locator("#sensors")).to_be_visible()
        await keys.press("Tab")
        await keys.press("Tab")
        await keys.press("Tab")
        await keys.press("Enter")  # the first sensor of the table
        await expect(page.locator("#choice-title")).to_have_text("below_1")


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


# Recordings that are not whole --------------------------------------------------------


async def test_a_live_run_appears_and_grows(planner_log: Path, tmp_path: Path) -> None:
    whole = in_chunks(planner_log, tmp_path / "whole.mcap", 4000)
    chunks = Recording.open(whole).layout.chunks
    data, log = whole.read_bytes(), tmp_path / "live.mcap"
    grown = [chunks[len(chunks) * part // 3].offset for part in (1, 2)]
    log.write_bytes(data[: grown[0]])
    live = True
    truth = derived(whole)
    async with opened(log, grows=lambda: live) as page:
        await expect(page.locator("#badge")).to_be_visible()
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
        await expect(page.locator("#badge")).to_be_hidden()
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


# For everybody ------------------------------------------------------------------------


@schemes
async def test_axe_finds_no_serious_fault(scheme: Scheme, planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}", scheme) as page:
        await wait_shown(page, TICKS)
        await page.evaluate(AXE.read_text(encoding="utf-8"))
        await page.click("#tab-sensors")
        await page.locator("#outline button").first.click()
        await page.locator("#choice button.link").first.click()
        await page.wait_for_selector("#choice .uplot canvas")
        for tab in ("sensors", "cells", "plots"):
            await page.click(f"#tab-{tab}")
            await page.wait_for_selector(f"#{tab}:not(:empty)")
            faults = await page.evaluate(
                """async () => (await axe.run()).violations
                    .filter(({ impact }) => impact === "serious" || impact === "critical")
                    .map(({ id, nodes }) => [id, nodes.map(({ html }) => html)])"""
            )
            assert faults == []


@schemes
async def test_it_fits_a_small_screen(scheme: Scheme, planner_log: Path) -> None:
    async with opened(planner_log, f"#t={TICKS}", scheme) as page:
        await wait_shown(page, TICKS)
        size = await page.evaluate(
            """() => {
                const { scrollWidth, scrollHeight } = document.documentElement;
                return [scrollWidth, scrollHeight];
            }"""
        )
        assert tuple(size) == SIZE
        for part in ("#search", "#help", "#fit", "#wave-play", "#taller", "#speed"):
            box = await page.locator(part).bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["y"] >= 0
            assert box["x"] + box["width"] <= SIZE[0]
            assert box["y"] + box["height"] <= SIZE[1]


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
                const sensor = items.find(({ kind }) => kind !== "sensor").sensors[0];
                return [sensor, diagram.whereIs({ sensor })];
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


@schemes
async def test_the_pictures_of_the_readme_can_be_taken(
    scheme: Scheme, planner_log: Path, tmp_path: Path
) -> None:
    async with opened(planner_log, scheme=scheme) as page:
        taken = await shoot(page, TICKS, GOAL, tmp_path)
    assert [path.name for path in taken] == [
        "view-diagram.png",
        "view-wave.png",
        "view-time.png",
    ]
    assert len({path.read_bytes() for path in taken}) == 3
