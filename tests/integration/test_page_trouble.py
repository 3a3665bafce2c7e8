"""What the page says in trouble, in a real browser.

A recording that is gone, a server that is gone, a seek that lasts.
"""

import asyncio
import re
import shutil
from pathlib import Path

import pytest
from playwright.async_api import Page, Route, expect

from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tests.support.browser_pages import IN_BROWSER, go_to, looked_at, opened
from tests.support.page_faults import faults
from tests.support.page_requests import get
from tests.support.recorded_runs import (
    csv_run,
    path_run,
    recorded,
    scripted_run,
    without_states,
)
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

TICKS = 300  # more than one block of frames
FAR = 290
FAILED = "Failed to load resource"


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(TICKS), tmp_path_factory.mktemp("long") / "long.mcap")


@pytest.fixture(scope="module")
def other_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("other")
    return recorded(csv_run(folder / "rows.csv"), folder / "other.mcap")


async def is_old(page: Page, old: bool = True) -> None:
    """Wait until what is shown is marked as old, or no longer is."""
    await expect(page.locator("body.old")).to_have_count(int(old))


async def test_a_recording_that_is_deleted_is_said_to_be(
    long_log: Path, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    shutil.copy(long_log, log)
    async with opened(log, "#t=5", but_for=FAILED) as page:
        await wait_shown(page, 5)
        log.unlink()
        notice = page.locator("#notice")
        await expect(notice).to_contain_text("run.mcap was deleted or moved")
        await is_old(page)
        await page.fill("#time", str(FAR))
        await expect(page.locator("#late")).to_have_text(
            f"this is tick 5, not tick {FAR}"
        )
        assert "not recorded" not in await notice.inner_text()
        assert await faults(page) == []


async def test_what_is_asked_for_once_a_recording_is_gone_is_no_gap(
    long_log: Path, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    shutil.copy(long_log, log)
    async with serving(ViewSession(log)) as address:
        log.unlink()
        status, body = await get(address, f"/api/frames?from={FAR}&to={FAR}")
        assert status == 500
        assert b"run.mcap was deleted or moved" in body


async def test_a_recording_that_is_replaced_is_never_mixed_with_the_one_before(
    long_log: Path, other_log: Path, tmp_path: Path
) -> None:
    log, other = tmp_path / "run.mcap", tmp_path / "other.mcap"
    shutil.copy(long_log, log)
    shutil.copy(other_log, other)
    async with opened(log, "#t=5", but_for=FAILED) as page:
        await wait_shown(page, 5)
        other.replace(log)
        await expect(page.locator("#notice")).to_contain_text(
            "run.mcap was replaced by another recording: reload the page"
        )
        await is_old(page)
        await page.fill("#time", str(FAR))
        await expect(page.locator("#late")).to_have_text(
            f"this is tick 5, not tick {FAR}"
        )
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
        await wait_shown(page, 5)
        await page.route("**/api/*", lambda route: route.abort())
        notice = page.locator("#notice")
        await expect(notice).to_contain_text("the server does not answer")
        await is_old(page)
        await page.unroute("**/api/*")
        await expect(notice).to_be_hidden()
        await is_old(page, False)


async def test_the_next_start_lets_in_who_was_let_in_before(long_log: Path) -> None:
    async with serving(ViewSession(long_log)) as address:
        pass
    async with serving(ViewSession(long_log), last=address) as again:
        assert again == address
        async with serving(ViewSession(long_log), last=address) as beside:
            assert beside.port != address.port
        async with looked_at(again.url) as page:
            await page.goto(again.url + "#t=5")
            await wait_shown(page, 5)
            assert await page.evaluate("location.href") == (
                f"http://127.0.0.1:{again.port}/#t=5"
            )


async def test_a_slow_seek_shows_that_it_lasts(long_log: Path) -> None:
    held: list[Route] = []
    came = asyncio.Event()

    async def hold(route: Route) -> None:
        held.append(route)
        came.set()

    async with opened(long_log, "#t=5") as page:
        await wait_shown(page, 5)
        await page.route(re.compile(rf"api/frames\?from={FAR}"), hold)
        await page.fill("#time", str(FAR))
        late = page.locator("#late")
        await expect(late).to_have_text(f"reading tick {FAR}; this is tick 5")
        assert await faults(page) == []
        await came.wait()
        for route in held:
            await route.continue_()
        await wait_shown(page, FAR)
        await expect(late).to_be_hidden()


@pytest.mark.parametrize(
    ("site", "words"),
    [
        ("none", "This browser has not been let in yet."),
        ("cross-site", "Copy the link, and paste it into the address bar."),
    ],
)
async def test_who_is_not_let_in_is_told_what_to_do(
    long_log: Path, site: str, words: str
) -> None:
    async with serving(ViewSession(long_log)) as address:
        told = [f"Sec-Fetch-Site: {site}", "Sec-Fetch-Dest: document"]
        status, body = await get(address, "/", *told, token=False)
        assert status in (401, 403)
        assert words in body.decode()
        assert address.token not in body.decode()


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_it_fits_a_phone(long_log: Path, scheme: Scheme) -> None:
    async with opened(long_log, "#t=5", scheme) as page:
        await page.set_viewport_size({"width": 360, "height": 740})
        await wait_shown(page, 5)
        for tab in ("plots", "sensors", "compare", "cells"):
            await page.click(f"#tab-{tab}")
            await page.wait_for_selector(f"#{tab}:not(:empty)")
            wide = await page.evaluate(
                """[...document.querySelectorAll("body, header, main, footer, main > *")]
                    .map((one) => one.scrollWidth)"""
            )
            assert max(wide) <= 360
            assert await faults(page) == []
        box = await page.locator("#diagram").bounding_box()
        assert box is not None
        assert 0.5 * 740 < box["height"] < 0.6 * 740


async def test_a_link_brings_what_was_looked_at(planner_log: Path) -> None:
    async with opened(planner_log, "#t=12") as page:
        await wait_shown(page, 12)
        await page.click("#tab-sensors")
        await page.locator("#outline tbody button").nth(3).click()
        name = await page.inner_text("#choice-title")
        waves = await page.locator("#wave-which option").evaluate_all(
            "(all) => all.map(({ value }) => value)"
        )
        await page.select_option("#wave-which", waves[1])
        await page.click("#nearer")
        view = await page.evaluate(
            "import('/main.js').then(({ page }) => page.diagram.view)"
        )
        await expect(page).to_have_url(re.compile("look="))
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
        again = await page.evaluate(
            "import('/main.js').then(({ page }) => page.diagram.view)"
        )
        for part in ("x", "y", "scale"):
            assert again[part] == pytest.approx(view[part], rel=1e-2, abs=1)
        await page.click("#fit")
        await expect(page).not_to_have_url(re.compile("look="))


async def test_a_link_to_an_edge_selects_it_and_a_bad_one_is_said(
    planner_log: Path,
) -> None:
    async with opened(planner_log, "#t=12&edge=0-2") as page:
        await wait_shown(page, 12)
        await expect(page.locator("#choice-title")).to_have_text("Selected edge")
    async with opened(planner_log, "#t=12&edge=0-9999") as page:
        await wait_shown(page, 12)
        await expect(page.locator("#notice")).to_have_text(
            "there is no edge 0-9999 here"
        )
    async with opened(planner_log, "#t=12&sensor=nobody&look=x&tab=none") as page:
        await go_to(page, 12)
        await expect(page.locator("#notice")).to_have_text(
            "there is no sensor nobody here"
        )


@pytest.fixture
def empty_log(tmp_path: Path) -> Path:
    whole = scripted_run([[True] * 3] * 3, tmp_path / "whole.mcap", source="-")
    return without_states(whole, tmp_path / "empty.mcap", {1, 2, 3})


async def test_a_recording_without_a_tick_says_so(empty_log: Path) -> None:
    async with (
        serving(ViewSession(empty_log)) as address,
        looked_at(address.url) as page,
    ):
        await page.goto(address.url)
        await expect(page.locator("#notice")).to_have_text("no tick was recorded")
        await expect(page.locator("#what")).to_contain_text("standard input, 3 sensors")
        for button in ("svg", "png", "csv"):
            await page.click(f"#save-{button}")
            said = page.locator("#said")
            await expect(said).to_have_text("there is no tick to save")
        await page.click("#tab-cells")
        heads = page.locator("#cells thead th")
        await expect(heads).to_have_text(["Part", "Sensors", "Messages", "Restarts"])
        assert await faults(page) == []
