"""The rows on going far in a recording on the page, where nothing is known yet."""

import asyncio
import statistics
import tempfile
from pathlib import Path

from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tools.bench.page import walks
from tools.bench.report import Line, Sizes
from tools.browser import NO_BROWSER, browsing, chromium, wait_shown

_WANTED = {500: 0.5, 2000: 1.5}
"""Seconds that a seek may take, by sensors."""
_SEEK = """async (tick) => {
    const { page } = await import("/main.js");
    const began = performance.now();
    page.time.player.seek(tick);
    const isShown = () => page.frame.tick === tick && page.order.graph.id === page.frame.graph;
    while (!isShown()) await new Promise(requestAnimationFrame);
    await new Promise(requestAnimationFrame);  // it is painted
    return performance.now() - began;
}"""


def seek(sizes: Sizes) -> list[Line]:
    """Go to ticks far from any that was looked at, each in a server of its own.

    Raises:
        FileNotFoundError: There is no Chromium.
    """
    if chromium() is None:
        raise FileNotFoundError(NO_BROWSER)
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for sensors in (sizes.crowd, 4 * sizes.crowd):
            log = asyncio.run(walks(Path(folder), sensors, sizes.ticks))
            times = [
                asyncio.run(_sought(log, tick))
                for tick in (sizes.ticks, sizes.ticks // 2, sizes.ticks * 3 // 4)
            ]
            lines.append(_line(sensors, times))
    return lines


def _line(sensors: int, times: list[float]) -> Line:
    wanted = _WANTED.get(sensors)
    middle, worst = statistics.median(times), max(times)
    return Line(
        f"a far tick on the page, {sensors} sensors",
        f"{middle:.2f} s",
        f"{worst:.2f} s the longest of {len(times)}",
        f"{wanted} s" if wanted else "",
        None if wanted is None else worst <= wanted,
        {"seconds": middle, "longest_seconds": worst},
    )


async def _sought(log: Path, tick: int) -> float:
    """Return how long it takes until a tick and its order are painted, in seconds."""
    async with serving(ViewSession(log)) as address, browsing() as opened:
        await opened.goto(f"{address.url}#t=1")
        await wait_shown(opened, 1)
        passed: float = await opened.evaluate(_SEEK, tick)
        return passed / 1000
