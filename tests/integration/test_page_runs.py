"""Recordings on the page: several, growing, replaced, gone, or empty."""

import asyncio
import re
import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace
from playwright.async_api import Page, Route, expect

from neurosnap import wire
from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.tick_difference import difference
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from tests.support.browser_pages import (
    IN_BROWSER,
    go_to,
    looked_at,
    opened,
    page_at,
    shown_tick,
    states,
    worded,
)
from tests.support.page_requests import get
from tests.support.recorded_messages import first
from tests.support.recorded_runs import (
    TICKS,
    csv_run,
    in_chunks,
    path_run,
    recorded,
    scripted_run,
    without_states,
)
from tests.support.rewritten_recordings import rewritten
from tools.browser import wait_shown

pytestmark = IN_BROWSER
LISTED = 50  # edges and classes
LONG = 300  # more ticks than a block of frames has
FAR = 290
FAILED = "Failed to load resource"
CUT = re.compile("^This recording is not whole: ")
MISSING = re.compile(CUT.pattern + r"messages are missing; [^·]*ends at tick \d+$")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two runs of the same readings; the second learns later, and stops earlier."""
    folder = tmp_path_factory.mktemp("compare")
    run = csv_run(folder / "rows.csv", TICKS)
    other = folder / "other"
    other.mkdir()
    cautious = replace(run, threshold=0.01, snapshot="discounted", decay=0.9)
    return recorded(run, folder / "run.mcap"), recorded(cautious, other / "run.mcap")


@pytest.mark.slow
async def test_another_recording_is_chosen_and_a_link_leads_to_it(
    logs: tuple[Path, Path],
) -> None:
    async with opened(logs[0], "#t=12", "light", logs[1]) as page:
        names = await page.locator("#run option").all_inner_texts()
        assert names == list(map(str, logs))
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


async def test_it_says_how_two_recordings_differ_at_a_tick(
    logs: tuple[Path, Path],
) -> None:
    views = [RunView(log) for log in logs]
    frames = [view.frames(1, TICKS) for view in views]
    parted = next(
        one.tick for one, other in zip(*frames, strict=True) if one.state != other.state
    )
    async with opened(logs[0], "#t=30", "light", logs[1]) as page:
        await page.click("#tab-compare")
        found = difference(views[0], 30, views[1], 30)
        assert found.here.count > 0
        heading = page.get_by_text(f"Implied here, not in {logs[1]}")
        await expect(heading).to_contain_text(str(found.here.count))
        learned = page.locator("#compare section").filter(has=heading)
        edges = learned.get_by_role("button")
        await expect(edges).to_have_count(len(found.here.edges))
        await edges.first.click()
        assert await page.inner_text("#choice-title") == "Selected edge"
        await go_to(page, parted)
        felt = difference(views[0], parted, views[1], parted).felt
        assert felt
        shown = page.get_by_role("table", name="Sensors that differ")
        await expect(shown.locator("tbody tr")).to_have_count(len(felt))
        await shown.get_by_role("button", name=felt[0].name).click()
        assert await page.inner_text("#choice-title") == felt[0].name


@pytest.fixture
def another_log(tmp_path: Path) -> Path:
    return recorded(path_run(seed=9), tmp_path / "another.mcap")


def cut_short(log: Path, target: Path, part: float) -> Path:
    """Keep a part of a recording's chunks."""
    whole = in_chunks(log, target.with_suffix(".whole"), 1000)
    chunks = Recording.open(whole).files[0].layout.chunks
    offset = chunks[int(len(chunks) * part)].offset
    target.write_bytes(whole.read_bytes()[:offset])
    return target


@pytest.mark.slow
async def test_another_recording_takes_the_place_of_the_one_before(
    path_log: Path, another_log: Path, tmp_path: Path
) -> None:
    # A part has died: the recording has its end, and the launcher still holds it.
    log = in_chunks(path_log, tmp_path / "run.mcap", 1000)
    other = cut_short(another_log, tmp_path / "other.mcap", 0.4)
    then = RunView(other).last
    assert 0 < then < RunView(log).last == TICKS
    # A tick may be asked for that the shorter recording, there already, does not have.
    beyond = "status of 400"
    live = opened(log, f"#t={TICKS}", grows=lambda: True, but_for=beyond)
    async with live as page:
        await wait_shown(page, TICKS)
        await page.click("#tab-sensors")
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                page.choose({ edge: { source: 0, target: 2, kind: "excite" } });
            }"""
        )
        await page.wait_for_selector(f'#choice-body[data-tick="{TICKS}"]')
        async with page.expect_response("**/api/presence") as looked:
            log.rename(tmp_path / "run.mcap.broken")
        assert "deleted or moved" in await (await looked.value).text()
        await expect(page.locator("#badge")).to_have_text("live")
        other.replace(log)
        await expect(page.locator("#tick")).to_have_text(f"tick {then} of {then}")
        await expect(page.locator("#depths-state")).to_have_text(f"{then} state waves")
        await expect(page.locator("#notice")).to_be_hidden()
        assert await states(page, then) == worded(another_log)[then]
        await page.wait_for_selector(f'#choice-body[data-tick="{then}"]')
        pressed = page.locator("#follow")
        await expect(pressed).to_have_attribute("aria-pressed", "false")


def with_a_stopped_cell(recorded: list[Recorded]) -> list[Recorded]:
    """Keep what comes before tick 20 has settled if ``cell/3`` stops in its wave."""
    place, begun = first(recorded, wire.WaveStart, lambda start: start.tick == 20)
    rest = (
        one
        for one in recorded[place + 1 :]
        if isinstance(one.message, wire.Pulse | wire.CellReport)
        and (one.message.wave, begun.kind) == (begun.wave, "state")
        and one.message.sender != "cell/3"
    )
    return [*recorded[: place + 1], *rest]


@pytest.mark.slow
async def test_whom_a_live_run_waits_for_is_named(
    path_log: Path, tmp_path: Path
) -> None:
    log = rewritten(path_log, tmp_path / "run.mcap", with_a_stopped_cell)
    names = RunView(log).options.sensors
    async with opened(log, "#t=19", grows=lambda: True) as page:
        waiting = page.locator("#waiting")
        await expect(waiting).to_have_text(
            re.compile(rf"^waiting for {names[3]} for \d")
        )
        await waiting.get_by_role("button").click()
        await expect(page.locator("#choice-title")).to_have_text(names[3])
        in_chunks(path_log, tmp_path / "whole.mcap", 1000).replace(log)
        await expect(waiting).to_be_hidden()


@pytest.mark.slow
async def test_a_tick_that_is_asked_for_too_early_leaves_no_blank_page(
    path_log: Path, tmp_path: Path
) -> None:
    whole = in_chunks(path_log, tmp_path / "whole.mcap", 1000)
    log = cut_short(path_log, tmp_path / "run.mcap", 0)
    async with (
        serving(ViewSession(log, lambda: True)) as address,
        looked_at(address.url) as page,
    ):
        await page.goto(f"{address.url}#t=5")
        await expect(page.locator("#tick")).to_have_text("no tick")
        with log.open("ab") as file:
            file.write(whole.read_bytes()[log.stat().st_size :])
        await wait_shown(page, 1)
        await expect(page.locator("#tick")).to_have_text(f"tick 1 of {TICKS}")
        await expect(page.locator("#notice")).to_be_hidden()


@pytest.mark.slow
async def test_news_is_taken_in_one_after_the_other(
    path_log: Path, tmp_path: Path
) -> None:
    log = cut_short(path_log, tmp_path / "run.mcap", 0.5)
    async with (
        serving(ViewSession(log, lambda: True)) as address,
        looked_at(address.url) as page,
    ):
        # The only news is the test's own.
        await page.add_init_script(
            "window.EventSource = class extends EventTarget { close() {} };"
        )
        await page.goto(address.url)
        await page.wait_for_selector("#drawing[data-tick]", state="attached")
        await expect(page.locator("#badge")).to_have_text("live")
        live = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const real = window.fetch;
                const answered = new Promise((answer) => {
                    window.fetch = async (what, given) => {
                        const response = await real(what, given);
                        if (what === "api/run") response.clone().json().then(answer);
                        return response;
                    };
                });
                const { ticks } = page.run;
                page.receive({ reset: true });
                page.receive({ reset: false, frames: [], ticks, live: false, cut: null });
                await answered;
                await page.received;
                await new Promise(requestAnimationFrame);
                window.fetch = real;
                return page.run.live;
            }"""
        )
        assert not live
        await expect(page.locator("#badge")).to_contain_text("ended")


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(LONG), tmp_path_factory.mktemp("long") / "long.mcap")


@pytest.fixture(scope="module")
def other_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("other")
    return recorded(csv_run(folder / "rows.csv"), folder / "other.mcap")


async def is_old(page: Page, old: bool = True) -> None:
    """Wait until what is shown is marked as old, or no longer is."""
    await expect(page.locator("body.old")).to_have_count(int(old))


@pytest.mark.slow
async def test_a_recording_that_is_replaced_is_never_mixed_with_the_one_before(
    long_log: Path, other_log: Path, tmp_path: Path
) -> None:
    log, other = tmp_path / "run.mcap", tmp_path / "other.mcap"
    shutil.copy(long_log, log)
    shutil.copy(other_log, other)
    async with opened(log, "#t=5", but_for=FAILED) as page:
        other.replace(log)
        await expect(page.locator("#notice")).to_contain_text(
            "run.mcap was replaced by another recording: reload the page"
        )
        await is_old(page)
        await page.fill("#time", str(FAR))
        await expect(page.locator("#late")).to_have_text(
            f"this is tick 5, not tick {FAR}"
        )
        await expect(page.locator("#notice")).not_to_contain_text("not recorded")
        await page.reload()
        await wait_shown(page, 5)
        await expect(page.locator("#what")).to_contain_text("rows.csv")
        await expect(page.locator("#notice")).to_be_hidden()
        await is_old(page, False)
        await page.wait_for_selector("#plots .u-over")  # it is read through, too


async def test_a_server_that_is_gone_is_said_to_be_until_it_is_back(
    long_log: Path,
) -> None:
    async with opened(long_log, "#t=5", but_for=FAILED) as page:
        await page.route("**/api/*", lambda route: route.abort())
        notice = page.locator("#notice")
        await expect(notice).to_contain_text("the server does not answer")
        await is_old(page)
        await page.unroute("**/api/*")
        await expect(notice).to_be_hidden()
        await is_old(page, False)


@pytest.mark.slow
async def test_a_slow_seek_shows_that_it_lasts(long_log: Path) -> None:
    held: list[Route] = []
    came = asyncio.Event()

    async def hold(route: Route) -> None:
        held.append(route)
        came.set()

    async with opened(long_log, "#t=5") as page:
        await page.route(re.compile(rf"api/frames\?from={FAR}"), hold)
        await page.fill("#time", str(FAR))
        late = page.locator("#late")
        await expect(late).to_have_text(f"reading tick {FAR}; this is tick 5")
        await came.wait()
        for route in held:
            await route.continue_()
        await wait_shown(page, FAR)
        await expect(late).to_be_hidden()


@pytest.mark.slow
async def test_a_link_brings_what_was_looked_at(planner_log: Path) -> None:
    async with opened(planner_log, "#t=12") as page:
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").nth(3).click()
        name = await page.inner_text("#choice-title")
        waves = await page.locator("#wave-which option").evaluate_all(
            "(all) => all.map(({ value }) => value)"
        )
        await page.select_option("#wave-which", waves[1])
        await expect(page).to_have_url(re.compile("sensor=.*wave="))
        link = await page.evaluate("location.hash")
        await page.goto("about:blank")
        await page.go_back()
        await page.evaluate(
            "(link) => { location.hash = link; location.reload(); }", link
        )
        await wait_shown(page, 12)
        assert await page.inner_text("#choice-title") == name
        assert await page.locator("#wave-which").input_value() == waves[1]
        assert await page.locator("#sensors").is_visible()


@pytest.fixture
def empty_log(tmp_path: Path) -> Path:
    whole = scripted_run([[True] * 3] * 3, tmp_path / "whole.mcap", source="-")
    return without_states(whole, tmp_path / "empty.mcap", {1, 2, 3})


@pytest.mark.slow
async def test_a_recording_without_a_tick_says_so(empty_log: Path) -> None:
    async with (
        serving(ViewSession(empty_log)) as address,
        looked_at(address.url) as page,
    ):
        await page.goto(address.url)
        await expect(page.locator("#notice")).to_contain_text("no tick was recorded")
        await expect(page.locator("#what")).to_contain_text("standard input, 3 sensors")


@pytest.mark.slow
async def test_a_tick_that_was_not_recorded_is_said_and_stepped_over(
    path_log: Path, tmp_path: Path
) -> None:
    log = without_states(path_log, tmp_path / "gap.mcap", {10, 11, 12})
    async with opened(log, "#t=9") as page:
        await page.evaluate(  # the block of this tick comes behind the tick
            """async () => {
                const { page } = await import("/main.js");
                while (page.frameCache.peek(10) === undefined)
                    await new Promise(requestAnimationFrame);
            }"""
        )
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        notice = page.locator("#notice")
        await expect(notice).to_have_text(MISSING)
        for tick in (10, 11, 12):
            await page.keyboard.press("ArrowRight")
            await expect(notice).to_contain_text(f"tick {tick} was not recorded")
            await expect(page.locator("body")).to_have_attribute("aria-busy", "false")
            assert await shown_tick(page) == 9
        await page.keyboard.press("ArrowRight")
        await wait_shown(page, 13)
        await expect(notice).to_have_text(MISSING)
        await go_to(page, 8)
        await page.select_option("#speed", "20")
        await page.click("#play")
        await wait_shown(page, TICKS)
        await expect(notice).to_have_text(MISSING)
        assert not any("frames" in url and "from=24" not in url for url in asked)


@pytest.mark.slow
async def test_what_is_wrong_is_said_until_it_is_no_longer_so(
    path_log: Path, tmp_path: Path
) -> None:
    whole = in_chunks(path_log, tmp_path / "whole.mcap", 4000)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    async with opened(cut, "#t=1") as page:
        # It has all it wants to plot.
        await expect(page.locator("#plots")).to_have_attribute("aria-busy", "false")
        notice = page.locator("#notice")
        await expect(notice).to_have_text(CUT)
        await page.evaluate(
            """() => {
                const real = window.fetch;
                Object.assign(window, { refused: true, gone: false });
                window.fetch = async (what) => {
                    if (window.gone) throw new TypeError("gone");
                    return window.refused && what.startsWith("api/raster")
                        ? Response.json({ error: "not so" }, { status: 500 })
                        : real(what);
                };
            }"""
        )
        await page.click("#tab-raster")
        await expect(notice).to_have_text(re.compile(f"{CUT.pattern}.* · not so$"))
        await page.evaluate("window.gone = true")
        await page.click("#tab-raster")
        await expect(notice).to_have_text(re.compile("not so · .* does not answer"))
        await page.evaluate("window.gone = false")
        await page.keyboard.press("n")  # where the next anomaly is, is always asked
        await expect(notice).to_have_text(re.compile(f"{CUT.pattern}.* · not so$"))
        await page.evaluate("window.refused = false")
        await page.click("#tab-raster")
        await expect(notice).not_to_contain_text("not so")
        await expect(notice).to_have_text(CUT)


@pytest.mark.slow
async def test_the_address_is_written_once_one_stays(path_log: Path) -> None:
    async with opened(path_log, "#t=5") as page:
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const real = history.replaceState;
                window.written = [];
                history.replaceState = function (...given) {
                    window.written.push(given[2]);
                    real.apply(history, given);
                };
                for (let k = 0; k < 30; k += 1) page.time.player.step(1);
            }"""
        )
        await wait_shown(page, 35)
        await expect(page).to_have_url(re.compile(r"#t=35$"))
        assert await page.evaluate("window.written") == ["/#t=35"]
        await page.evaluate(
            "import('/main.js').then(({ page }) => page.time.player.follow())"
        )
        await expect(page).to_have_url(re.compile(r"/$"))


@pytest.mark.slow
async def test_what_the_server_says_without_a_page(
    long_log: Path, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    shutil.copy(long_log, log)
    async with serving(ViewSession(log)) as address:
        for site, words in {
            "none": "that of the address neurosnap view printed: open that first",
            "cross-site": "paste it into the address bar",
        }.items():
            told = f"Sec-Fetch-Site: {site}"
            status, body = await get(address, "/", told, token=False)
            assert status in (401, 403)
            assert words in body.decode()
            assert address.token not in body.decode()
        log.unlink()
        status, body = await get(address, f"/api/frames?from={FAR}&to={FAR}")
        assert (status, b"run.mcap was deleted or moved" in body) == (500, True)


@pytest.mark.slow
async def test_a_link_to_an_edge_selects_it_and_a_bad_one_is_said(
    planner_log: Path,
) -> None:
    for link, where, said in [
        ("edge=0-2", "#choice-title", "Selected edge"),
        ("edge=0-9999", "#notice", "there is no edge 0-9999 here"),
        ("sensor=nobody&tab=none", "#notice", "there is no sensor nobody here"),
    ]:
        async with opened(planner_log, f"#t=12&{link}") as page:
            await expect(page.locator(where)).to_have_text(said)


FRAMES = """
    const { FrameCache } = await import("/run/frames.js");
    const asked = [];
"""
ALONE = {
    "a link that is back may be to another recording": (
        """
        const { follow } = await import("/run/live.js");
        const [stream, told] = [new EventTarget(), []];
        const tell = (what) => told.push(what);
        follow(() => stream, tell, tell);
        for (const name of ["open", "error", "error", "open"]) {
            stream.dispatchEvent(new Event(name));
        }
        return told;
        """,
        [True, False, False, True, {"reset": True}],
    ),
    "a server that is gone is not asked again and again": (
        FRAMES
        + """
        const later = [];
        const set = window.setTimeout;
        window.setTimeout = (act) => later.push(act);
        const frameCache = new FrameCache(async (from) => {
            asked.push(from);
            throw new Error("gone");
        });
        frameCache.last = 300;
        const frame = async () => {
            frameCache.isReady(5);
            await frameCache.at(5).catch(() => {});
        };
        for (let k = 0; k < 20; k += 1) await frame();
        for (const act of later) act();
        await frame();
        window.setTimeout = set;
        return asked;
        """,
        [1, 24, 5, 1, 24, 5],
    ),
    "the tick that is wanted does not wait for its block": (
        FRAMES
        + """
        const frameCache = new FrameCache(async (from, to) => {
            asked.push([from, to]);
            if (from !== to) await new Promise(() => {}); // it takes long
            return [{ tick: from }];
        });
        frameCache.last = 300;
        frameCache.isReady(130);
        return [...asked, (await frameCache.at(150)).tick, ...asked.slice(2)];
        """,
        [[120, 143], [144, 167], 150, [150, 150]],
    ),
    "of blocks that were gone to the last is fetched, one at a time": (
        FRAMES
        + """
        const begun = [];
        const frameCache = new FrameCache(async (from, to) => {
            asked.push(from);
            if (from !== to) await new Promise((end) => begun.shift()(end));
            return [{ tick: from }];
        });
        const next = () => new Promise((begin) => begun.push(begin));
        frameCache.last = 300;
        let block = next();
        await frameCache.at(150);
        const end = await block;
        block = next();
        for (const tick of [30, 60, 250]) await frameCache.at(tick);
        end();
        await block;
        return asked;
        """,
        [150, 144, 30, 60, 250, 240],
    ),
    "a question that takes long is named until it is answered": (
        """
        const { ask } = await import("/base/api.js");
        const [set, get] = [window.setTimeout, window.fetch];
        let [late, answer] = [null, null];
        window.setTimeout = (act, after) => (late = after === 300 && act);
        window.fetch = () => new Promise((soon) => (answer = () => soon(Response.json({}))));
        const sign = document.querySelector("#reading");
        const told = [];
        for (const [what, query] of [
            ["frames", { from: 400, to: 400 }],
            ["frames", { from: 360, to: 479 }],
            ["graph", { tick: 7 }],
        ]) {
            const asked = ask(what, query);
            told.push(sign.hidden);
            late();
            told.push(sign.hidden, sign.textContent);
            answer();
            await asked;
        }
        [window.setTimeout, window.fetch] = [set, get];
        return [...told, sign.hidden];
        """,
        [
            *(True, False, "reading tick 400 …"),
            *(True, False, "reading ticks 360 to 479 …"),
            *(True, False, "reading the order at tick 7 …"),
            True,
        ],
    ),
    "a frame that is early or late skips no tick": (
        """
        const { Player } = await import("/time/player.js");
        const player = new Player({ ready: () => true, move() {}, change() {} });
        player.setRange(1, 1000);
        player.setSpeed(60);
        player.play();
        const late = (k) => 0.4 * Math.sin(7 * k); // of a frame
        const frames = Array.from({ length: 599 }, (_, k) => (k + 1 + late(k)) * 1000 / 60);
        const shown = [0, ...frames].map((frame) => {
            player._advance(frame);
            return player.tick;
        });
        player.pause();
        return shown;
        """,
        list(range(1, 601)),
    ),
}
"""What parts of the page do by themselves, and what comes of it."""


@pytest.mark.slow
async def test_each_part_does_its_own(path_log: Path) -> None:
    page = await page_at(path_log, 1)
    for what, (script, expected) in ALONE.items():
        found = await page.evaluate(f"async () => {{ {script} }}")
        assert found == expected, what
