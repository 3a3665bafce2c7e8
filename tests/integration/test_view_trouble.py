"""What the page of `neurosnap view` does where something is missing or goes wrong.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

import re
from pathlib import Path

from playwright.async_api import Page, expect

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tests.support.browser_pages import (
    IN_BROWSER,
    go_to,
    looked_at,
    opened,
    shown_tick,
)
from tests.support.recorded_runs import TICKS, in_chunks, without_states
from tools.browser import wait_shown

pytestmark = IN_BROWSER

CUT = re.compile("^This recording is not whole: ")


async def plots_are_there(page: Page) -> None:
    """Wait until the page has all it wants to plot."""
    await page.evaluate(
        """async () => {
            const { page } = await import("/main.js");
            while (page.plots._asking) await new Promise(requestAnimationFrame);
        }"""
    )


async def test_a_tick_that_was_not_recorded_is_said_and_stepped_over(
    path_log: Path, tmp_path: Path
) -> None:
    log = without_states(path_log, tmp_path / "gap.mcap", {10, 11, 12})
    async with opened(log, "#t=9") as page:
        await wait_shown(page, 9)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        notice = page.locator("#notice")
        for tick in (10, 11, 12):
            await page.keyboard.press("ArrowRight")
            await expect(notice).to_have_text(f"tick {tick} was not recorded")
            await expect(page.locator("body")).to_have_attribute("aria-busy", "false")
            assert await shown_tick(page) == 9
        await page.keyboard.press("ArrowRight")
        await wait_shown(page, 13)
        await expect(notice).to_be_hidden()
        await go_to(page, 8)
        await page.select_option("#speed", "20")
        await page.click("#play")
        await wait_shown(page, TICKS)
        await expect(notice).to_be_hidden()
        assert not any("frames" in url for url in asked)


async def test_a_server_that_is_gone_is_not_asked_again_and_again(
    path_log: Path,
) -> None:
    async with opened(path_log) as page:
        asked = await page.evaluate(
            """async () => {
                const { FrameCache } = await import("/run/frames.js");
                const later = [];
                const set = window.setTimeout;
                window.setTimeout = (act) => later.push(act);
                const asked = [];
                const frameCache = new FrameCache(async (from) => {
                    asked.push(from);
                    throw new Error("gone");
                });
                frameCache.last = 300;
                const frame = async () => {
                    frameCache.prefetch(5);
                    await frameCache.at(5).catch(() => {});
                };
                for (let k = 0; k < 20; k += 1) await frame();
                for (const act of later) act();
                await frame();
                window.setTimeout = set;
                return asked;
            }"""
        )
    assert asked == [120, 5, 120, 5]


async def test_the_tick_that_is_wanted_does_not_wait_for_its_block(
    path_log: Path,
) -> None:
    async with opened(path_log) as page:
        asked, tick = await page.evaluate(
            """async () => {
                const { FrameCache } = await import("/run/frames.js");
                const asked = [];
                const frameCache = new FrameCache(async (from, to) => {
                    asked.push([from, to]);
                    if (from !== to) await new Promise(() => {}); // it takes long
                    return [{ tick: from }];
                });
                frameCache.last = 300;
                frameCache.ask(130);
                return [asked, (await frameCache.at(150)).tick];
            }"""
        )
    assert asked == [[120, 239], [150, 150]]
    assert tick == 150


async def test_what_is_wrong_is_said_until_it_is_no_longer_so(
    path_log: Path, tmp_path: Path
) -> None:
    whole = in_chunks(path_log, tmp_path / "whole.mcap", 4000)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    last = RunView(cut).last
    async with opened(cut) as page:
        await wait_shown(page, 1)
        await plots_are_there(page)
        notice = page.locator("#notice")
        await expect(notice).to_have_text(CUT)
        await page.evaluate(
            """() => {
                const real = window.fetch;
                const answer = async () => Response.json({ error: "not so" }, { status: 500 });
                const gone = async () => { throw new TypeError("gone"); };
                const ways = [answer, gone, real];
                const never = () => new Promise(() => {}); // it would say that it is there
                window.fetch = (what) => {
                    if (what === "api/presence") return never();
                    return (what === "api/cells" ? ways.shift() : real)(what);
                };
            }"""
        )
        await page.click("#tab-cells")
        await expect(notice).to_have_text(re.compile(f"{CUT.pattern}.* · not so$"))
        await page.click("#tab-cells")
        await expect(notice).to_have_text(re.compile("not so · .* does not answer"))
        await go_to(page, last)  # its order was not asked for before, and is answered
        await expect(notice).to_have_text(re.compile(f"{CUT.pattern}.* · not so$"))
        await page.click("#tab-cells")
        await page.wait_for_selector("#cells tbody tr")
        await expect(notice).not_to_contain_text("not so")
        await expect(notice).to_have_text(CUT)


async def test_a_question_that_is_dropped_while_it_is_answered_is_no_error(
    path_log: Path,
) -> None:
    async with opened(path_log) as page:
        said = await page.evaluate(
            """async () => {
                const { fetchEdge } = await import("/base/api.js");
                const drop = new AbortController();
                const real = window.fetch;
                window.fetch = async (what, { signal }) => {
                    const body = new ReadableStream({
                        start: (into) => signal.addEventListener("abort", () =>
                            into.error(signal.reason)),
                        pull: () => drop.abort(),
                    });
                    return new Response(body);
                };
                const said = await fetchEdge(0, 2, 1, drop.signal).catch(({ name }) => name);
                window.fetch = real;
                return said;
            }"""
        )
    assert said == "AbortError"


async def test_an_edge_says_nothing_of_a_tick_that_was_left(path_log: Path) -> None:
    async with opened(path_log, "#t=20") as page:
        await wait_shown(page, 20)
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                page.choose({ edge: page.graph.edges[0] });
            }"""
        )
        await page.wait_for_selector('#choice-body[data-tick="20"]')
        asked = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const [set, clear] = [window.setTimeout, window.clearTimeout];
                const waiting = new Set();
                page.choice._edge._ask = () => {};
                window.setTimeout = (act, wait) => {
                    const id = set(act, wait);
                    if (`${act}`.includes("_ask")) waiting.add(id);
                    return id;
                };
                window.clearTimeout = (id) => {
                    waiting.delete(id);
                    clear(id);
                };
                const asked = [1, -1].map((ticks) => {
                    page.player.step(ticks);
                    return waiting.size;
                });
                [window.setTimeout, window.clearTimeout] = [set, clear];
                return asked;
            }"""
        )
    assert asked == [1, 0]


async def test_the_plot_of_an_edge_is_one_and_is_taken_away(path_log: Path) -> None:
    async with opened(path_log, "#t=20") as page:
        await wait_shown(page, 20)
        session = await page.context.new_cdp_session(page)

        async def listening() -> int:
            found = await session.send("Runtime.evaluate", {"expression": "window"})
            window = {"objectId": found["result"]["objectId"]}
            all_ = await session.send("DOMDebugger.getEventListeners", window)
            return sum(each["type"] == "dppxchange" for each in all_["listeners"])

        await plots_are_there(page)
        alone = await listening()
        for source, target in [(0, 2), (2, 4)]:
            await page.evaluate(
                """async (edge) => {
                    document.querySelector("#choice-body").dataset.tick = "";
                    (await import("/main.js")).page.choose({ edge });
                }""",
                {"source": source, "target": target, "kind": "excite"},
            )
            for tick in (20, 21, 22):
                await go_to(page, tick)
                await page.wait_for_selector(f'#choice-body[data-tick="{tick}"]')
                assert await listening() == alone + 1
        await page.keyboard.press("l")
        assert await listening() == alone + 1
        await page.click("#choice-close")
        assert await listening() == alone


async def test_a_plot_says_of_which_tick_a_value_is_where_some_were_thinned_out(
    planner_log: Path,
) -> None:
    async with opened(planner_log, "#t=20") as page:
        await wait_shown(page, 20)
        await plots_are_there(page)
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                page.plots._on.fetchSeries = async () =>
                    ({ ticks: [1, 19, 30], values: [4, 9, 7], done: true });
                await page.plots.load(1, 40);
            }"""
        )
        captions = page.locator("#plots figcaption")
        told = {20: "9 at 19", 30: "7", 19: "9", 18: "4 at 1", 31: "7 at 30"}
        for tick, value in told.items():
            await go_to(page, tick)
            await expect(captions.nth(1)).to_have_text(f"Err {value} ")
            await expect(captions.nth(5)).to_have_text(f"Distance to target {value} ")


async def test_the_address_is_written_once_one_stays(path_log: Path) -> None:
    async with opened(path_log, "#t=5") as page:
        await wait_shown(page, 5)
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const real = history.replaceState;
                window.written = [];
                history.replaceState = function (...given) {
                    window.written.push(given[2]);
                    real.apply(history, given);
                };
                for (let k = 0; k < 30; k += 1) page.player.step(1);
            }"""
        )
        await wait_shown(page, 35)
        await expect(page).to_have_url(re.compile(r"#t=35$"))
        assert await page.evaluate("window.written") == ["/#t=35"]
        assert (
            await page.evaluate(
                """async () => {
                const { page } = await import("/main.js");
                page.player.follow();
                page.timeline._keep();
                return location.hash;
            }"""
            )
            == ""
        )


async def test_it_opens_where_nothing_can_be_kept(path_log: Path) -> None:
    async with (
        serving(ViewSession(path_log)) as address,
        looked_at(address.url) as page,
    ):
        await page.add_init_script(
            """Object.defineProperty(window, "localStorage", {
                get() { throw new DOMException("blocked", "SecurityError"); },
            });"""
        )
        await page.goto(address.url)
        await wait_shown(page, 1)
        for theme in ("dark", "light"):
            await page.keyboard.press("l")
            await expect(page.locator("html")).to_have_attribute("data-theme", theme)
