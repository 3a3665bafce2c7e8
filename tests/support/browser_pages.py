"""The page in a real browser, and the expected text for every sensor's state."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from threading import Barrier, Thread
from typing import Any, TypeVar

import pytest
from playwright.async_api import Browser, ConsoleMessage, Page

from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from tools.browser import NO_BROWSER, Scheme, chromium, new_page, wait_shown

T = TypeVar("T")

IN_BROWSER = [
    pytest.mark.skipif(chromium() is None, reason=NO_BROWSER),
    # One browser, and so one loop; each test has pages of its own.
    pytest.mark.asyncio(loop_scope="session"),
    pytest.mark.usefixtures("browser"),
]
"""What marks the tests of the page."""

shared: list[Browser] = []
"""The browser of all tests, while there is one."""
kept: dict[Path, Page] = {}
"""The pages that several tests look at, by their recordings."""
kept_open = AsyncExitStack()


class KeptServers:
    """Serves recordings to `kept` pages as long as the tests last.

    In a thread and a loop of its own: those of a test must be as before at its end.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        # All threads begin here: one that began later would outlive a test.
        pool, begun = ThreadPoolExecutor(4), Barrier(5)
        for _ in range(4):
            pool.submit(begun.wait)
        begun.wait()
        self._loop.set_default_executor(pool)
        self._thread = Thread(target=self._loop.run_forever)
        self._thread.start()
        self._open = AsyncExitStack()

    async def serve(self, log: Path) -> str:
        """Serve a recording; return where."""
        entering = self._open.enter_async_context(serving(ViewSession(log)))
        return (await self._done(entering)).url

    async def end(self) -> None:
        """End all of them."""
        await self._done(self._open.aclose())
        await self._done(self._loop.shutdown_default_executor())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _done(self, work: Coroutine[Any, Any, T]) -> T:
        """Return what comes of work that is done in that loop."""
        ended = asyncio.run_coroutine_threadsafe(work, self._loop)  # noqa: TID251
        return await asyncio.wrap_future(ended)


servers: list[KeptServers] = []
_WORDS = {1: "on", 0: "off", None: "unknown"}
_REST = """async () => {
    const { page } = await import("/main.js");
    const { player, range } = page.time;
    player.pause();
    player.setSpeed(2);
    range.set(null);
    page.choose(null);
    page.wave.take("");
    page.order.focus.layOut(false);
    const depth = document.querySelector("#focus-depth");
    depth.value = "Infinity";
    depth.dispatchEvent(new Event("change"));
    for (const [home, pressed] of [["edges", "true"], ["only", "false"]]) {
        for (const chip of document.querySelectorAll(`#focus-${home} button`)) {
            if (chip.ariaPressed !== pressed) chip.click();
        }
    }
    if (document.querySelector("main.tall")) document.querySelector("#taller").click();
    document.querySelector("#tab-plots").click();
    document.querySelector("#keys").close();
    document.activeElement.blur();
}"""


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

    Scheme and `still` are as in `new_page`. A console message that holds `but_for` is
    no failure; empty: none.
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


async def page_at(log: Path, tick: int) -> Page:
    """Return the page of a recording at a tick, with nothing selected or sought.

    Tests that leave nothing else behind share it: to load it anew takes five times the
    work of the test.
    """
    if log not in kept:
        url = await servers[-1].serve(log)
        kept[log] = await kept_open.enter_async_context(looked_at(url))
        await kept[log].goto(f"{url}#t={tick}")
        await wait_shown(kept[log], tick)
    page = kept[log]
    await page.mouse.move(0, 0)
    await page.fill("#search-text", "")
    await page.evaluate(_REST)
    await go_to(page, tick)
    return page


async def go_to(page: Page, tick: int) -> None:
    await page.fill("#time", str(tick))
    await wait_shown(page, tick)


async def shown_tick(page: Page) -> int:
    return int(await page.get_attribute("#drawing", "data-tick") or "0")


async def states(page: Page, tick: int) -> list[str]:
    """Return what the table in words says of every sensor at a tick."""
    await page.wait_for_selector(f'#outline[data-tick="{tick}"]', state="attached")
    return await page.locator("#outline td.state").all_inner_texts()


def worded(log: Path) -> dict[int, list[str]]:
    """Return what a view says of every sensor, tick by tick, in the page's words.

    That it says what a replay does is tested with the view.
    """
    view = RunView(log)
    return {
        frame.tick: [
            "contradicted" if sensor in frame.contradicted else _WORDS[held]
            for sensor, held in enumerate(frame.state)
        ]
        for frame in view.frames(1, view.last)
    }
