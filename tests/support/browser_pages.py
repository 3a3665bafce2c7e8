"""The page in a real browser, and what it should say: a replay, in the page's words."""

import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser, ConsoleMessage, Page

from neurosnap import wire
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.replay import Replay
from neurosnap.sensorium import unpack
from tools.browser import NO_BROWSER, Scheme, chromium, new_page, wait_shown

IN_BROWSER = [
    pytest.mark.skipif(chromium() is None, reason=NO_BROWSER),
    # One browser, and so one loop; each test has pages of its own.
    pytest.mark.asyncio(loop_scope="session"),
    pytest.mark.usefixtures("browser"),
]
"""What marks the tests of the page."""

shared: list[Browser] = []
"""The browser of all tests, while there is one."""


@asynccontextmanager
async def opened(
    log: Path,
    where: str = "",
    scheme: Scheme = "light",
    *others: Path,
    grows: Callable[[], bool] = lambda: False,
    still: bool = False,
    but_for: str = "",
) -> AsyncIterator[Page]:
    """Serve recordings and look at the first until the page shows the link's tick."""
    sessions = [ViewSession(each, grows) for each in (log, *others)]
    async with (
        serving(*sessions) as address,
        looked_at(address.url, scheme, still=still, but_for=but_for) as page,
    ):
        await page.goto(address.url + where)
        if tick := re.search(r"\bt=(\d+)", where):
            await wait_shown(page, int(tick[1]))
        else:
            await page.wait_for_selector("#drawing[data-tick]", state="attached")
        yield page


@asynccontextmanager
async def looked_at(
    url: str, scheme: Scheme = "light", *, still: bool = False, but_for: str = ""
) -> AsyncIterator[Page]:
    """Give a page that may go to one server alone, and where nothing may fail.

    Args:
        url: The server's.
        scheme: As in `new_page`.
        still: As in `new_page`.
        but_for: What a console message may hold that is no failure; empty: none.
    """
    strange: list[str] = []
    home = url.partition("?")[0]

    def on_console(message: ConsoleMessage) -> None:
        spared = but_for and but_for in message.text
        if message.type in ("error", "warning") and not spared:
            strange.append(message.text)

    def on_address(asked: str) -> None:
        if not asked.startswith(home):
            strange.append(asked)

    async with new_page(shared[-1], scheme, still=still) as page:
        page.on("console", on_console)
        page.on("crash", lambda _: strange.append("the page crashed"))
        page.on("pageerror", lambda error: strange.append(str(error)))
        page.on("request", lambda request: on_address(request.url))
        page.on("websocket", lambda socket: on_address(socket.url))
        yield page
    # Pytest rewrites no asserts here: without a message it would not say what.
    assert strange == [], f"strange: {strange}"


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
        each.message.tick: each.message
        for each in recording.messages(("observation",))
        if isinstance(each.message, wire.Observation)
    }
    replay = Replay(recording)
    found = {}
    for tick in replay.ticks():
        state = replay.core.snapshot.state.reshape(-1, 2)
        bits = unpack(observed[tick].bits, len(state))
        known = np.ones(len(state), np.bool_)
        if observed[tick].known:
            known = unpack(observed[tick].known, len(state))
        read = np.stack([bits & known, ~bits & known], axis=1).ravel()
        above = replay.core.graph.up(read).reshape(-1, 2)
        neither = np.where(above.all(axis=1), "contradicted", "unknown")
        found[tick] = [
            "on" if on else "off" if off else str(other)
            for (on, off), other in zip(state.tolist(), neither, strict=True)
        ]
    return found
