"""A browser that opens the page of `neurosnap view`, for tests and measurements."""

import asyncio
import os
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Literal

from playwright.async_api import Browser, Page, async_playwright

SIZE = 1280, 720
Scheme = Literal["light", "dark"]

_PATIENCE = 240.0
"""Seconds until what a page must show is given up: a net for hangs."""

# It asks nobody anything: what a page fetches is what the page fetches.
_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",  # a container's may be too small, which is a crash
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


NO_BROWSER = "needs chromium: apt-get install chromium-headless-shell"
"""What to say where there is none."""


def chromium() -> str | None:
    """Return where Debian's Chromium is; None: it is not there.

    The one without windows comes first: it is the same engine and takes half the
    processor time for a page.
    """
    found = map(shutil.which, ("chromium-headless-shell", "chromium"))
    return os.environ.get("CHROMIUM") or next(filter(None, found), None)


@asynccontextmanager
async def started() -> AsyncIterator[Browser]:
    """Start a browser.

    Raises:
        FileNotFoundError: There is no Chromium.
    """
    if chromium() is None:
        raise FileNotFoundError(NO_BROWSER)
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=chromium(), args=_ARGUMENTS, timeout=_PATIENCE * 1000
        )
        try:
            yield browser
        finally:
            await browser.close()


@asynccontextmanager
async def new_page(
    browser: Browser, scheme: Scheme = "light", *, still: bool = False
) -> AsyncIterator[Page]:
    """Open an empty page that shares nothing with the browser's others.

    Args:
        browser: Where.
        scheme: The colours the system is said to have.
        still: Whether the system is said to want no motion.
    """
    page = await browser.new_page(
        viewport={"width": SIZE[0], "height": SIZE[1]},
        color_scheme=scheme,
        reduced_motion="reduce" if still else "no-preference",
    )
    page.set_default_timeout(_PATIENCE * 1000)
    try:
        yield page
    finally:
        await page.close()


@asynccontextmanager
async def browsing() -> AsyncIterator[Page]:
    """Open an empty page in a browser of its own.

    Raises:
        FileNotFoundError: There is no Chromium.
    """
    async with started() as browser, new_page(browser) as page:
        yield page


async def wait_shown(page: Page, tick: int) -> None:
    """Wait until the page shows a tick, its order and its plots."""
    shown = f'#drawing[data-tick="{tick}"][aria-busy="false"]'
    await page.wait_for_selector(shown, state="attached")
    plots = "#plots canvas, #plots[hidden]"
    await page.wait_for_selector(plots, state="attached")


async def wait_until(page: Page, condition: str) -> None:
    """Wait until an expression is true; the page's own rules forbid the usual way.

    Raises:
        TimeoutError: It does not become true.
    """
    async with asyncio.timeout(_PATIENCE):
        while not await page.evaluate(condition):
            await page.evaluate("new Promise(requestAnimationFrame)")
