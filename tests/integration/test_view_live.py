"""A recording that grows, or is another all at once, on the page of `neurosnap view`.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.recording.read.recording import Recording
from tests.support import browser_pages as pages
from tests.support.browser_pages import IN_BROWSER, derived, looked_at, opened, states
from tests.support.recorded_runs import TICKS, in_chunks, path_run, recorded
from tools.browser import started, wait_shown

pytestmark = IN_BROWSER


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


async def test_another_recording_takes_the_place_of_the_one_before(
    path_log: Path, another_log: Path, tmp_path: Path
) -> None:
    log = cut_short(path_log, tmp_path / "run.mcap", 0.7)
    other = cut_short(another_log, tmp_path / "other.mcap", 0.4)
    first, then = RunView(log).last, RunView(other).last
    assert 0 < then < first < TICKS
    # A tick may be asked for that the shorter recording, there already, does not have.
    beyond = "status of 400"
    live = opened(log, f"#t={first}", grows=lambda: True, but_for=beyond)
    async with live as page:
        await wait_shown(page, first)
        await page.click("#tab-sensors")
        await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                page.choose({ edge: { source: 0, target: 2, kind: "excite" } });
            }"""
        )
        await page.wait_for_selector(f'#choice-body[data-tick="{first}"]')
        other.replace(log)
        await expect(page.locator("#tick")).to_have_text(f"tick {then} of {then}")
        assert await states(page, then) == derived(another_log)[then]
        await page.wait_for_selector(f'#choice-body[data-tick="{then}"]')
        pressed = page.locator("#follow")
        await expect(pressed).to_have_attribute("aria-pressed", "false")


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


async def test_a_link_that_is_back_may_be_to_another_recording(path_log: Path) -> None:
    async with opened(path_log) as page:
        told = await page.evaluate(
            """async () => {
                const { follow } = await import("/run/live.js");
                const [stream, told] = [new EventTarget(), []];
                const tell = (what) => told.push(what);
                follow(() => stream, tell, tell);
                for (const name of ["open", "error", "error", "open"]) {
                    stream.dispatchEvent(new Event(name));
                }
                return told;
            }"""
        )
    assert told == [True, False, False, True, {"reset": True}]


async def test_a_browser_that_has_gone_spoils_no_later_test(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with started() as gone:
        pass
    assert not gone.is_connected()
    monkeypatch.setattr(pages, "shared", [gone])
    async with opened(path_log, "#t=3") as page:
        await wait_shown(page, 3)


async def test_what_was_strange_is_said() -> None:
    with pytest.raises(AssertionError, match=r"strange: \['something odd'\]"):
        async with looked_at("about:blank") as page, page.expect_console_message():
            await page.evaluate("console.error('something odd')")
