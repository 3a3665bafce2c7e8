#!/usr/bin/env python3
"""Take the pictures of `neurosnap view` in docs/: one of each main view.

    tools/screenshots.py LOG [--tick TICK] [--signal NAME] [--out DIR] [--dark]

The recording should be a planner's: only its waves go deep.
"""

import argparse
import asyncio
import sys
from pathlib import Path

# Run as a file, the folder of this file is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from playwright.async_api import Page

from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tools.browser import Scheme, browsing, wait_shown, wait_until


async def shoot(page: Page, tick: int, signal: str, folder: Path) -> list[Path]:
    """Take the pictures of an open page.

    Args:
        page: It shows a recording.
        tick: What to show.
        signal: The first literal of the wave to show.
        folder: Where they go.
    """
    taken = []

    async def take(name: str) -> None:
        taken.append(folder / f"view-{name}.png")
        await page.screenshot(path=taken[-1])

    await page.fill("#time", str(tick))
    await wait_shown(page, tick)
    await take("diagram")
    await page.select_option("#wave-which", signal)
    hops = int(await page.get_attribute("#wave-hop", "max") or "0")
    await page.fill("#wave-hop", str(hops // 2 + 0.5))  # pulses are on their way
    # Large enough to be read, in the middle of where it is.
    sensor = signal.removesuffix("*")
    await page.fill("#search-text", sensor)
    await page.press("#search-text", "Enter")
    await page.press("#search-text", "Escape")
    await page.click("#nearer")
    await page.click("#choice-close")
    await take("wave")
    await page.press("body", "w")
    await page.press("body", "0")
    await page.click("#tab-plots")
    await page.press("body", "t")
    await wait_until(page, "document.querySelector('#plots .uplot').clientHeight > 99")
    await take("time")
    return taken


async def _main(given: argparse.Namespace) -> None:
    given.out.mkdir(parents=True, exist_ok=True)
    scheme: Scheme = "dark" if given.dark else "light"
    async with serving(ViewSession(given.log)) as address, browsing(scheme) as page:
        await page.goto(address.url)
        await page.wait_for_selector("#drawing[data-tick]", state="attached")
        for path in await shoot(page, given.tick, given.signal, given.out):
            print(path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="screenshots", description="Take pictures.")
    parser.add_argument("log", type=Path, help="a planner's recording")
    parser.add_argument("--tick", type=int, required=True, help="what to show")
    parser.add_argument("--signal", required=True, help="a wave, by its first literal")
    parser.add_argument("--out", type=Path, default=Path("docs"), help="where they go")
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    return parser


if __name__ == "__main__":
    asyncio.run(_main(_parser().parse_args()))
