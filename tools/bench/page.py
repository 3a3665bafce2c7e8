"""Measures the page without a graphics card: playing, and seeking a far tick."""

import asyncio
import statistics
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace
from playwright.async_api import CDPSession

from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.server import serving
from tools.bench.report import Line, Sizes
from tools.bench.run import line_options, run_once
from tools.browser import NO_BROWSER, browsing, chromium, wait_shown

_SPEED = 60
_WARM = 10  # ticks learned before the clock starts: the first orders are large
_PLAY = """async (speed) => {
    const { page } = await import("/main.js");
    page.time.player.setSpeed(speed);
    page.time.player.play();
    const seen = [];
    for (;;) {
        const now = await new Promise(requestAnimationFrame);
        if (!page.time.player.playing) return seen;
        seen.push([now, page.frame.tick]);
    }
}"""

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


class Shown(NamedTuple):
    """One of the browser's frames."""

    time: float
    """When it came, in milliseconds."""
    tick: int
    """What it showed."""


def page(sizes: Sizes) -> list[Line]:
    """Play recordings at sixty ticks a second, and time the browser's frames."""
    small, large = sizes.sensors[0], sizes.crowd
    crowd = f"{large} sensors, those around one drawn"
    with _walks(sizes.ticks, small, large) as (few, many):
        return [
            asyncio.run(_played(f"{small} sensors", few)),
            asyncio.run(_played(crowd, many, f"&sensor=w0_below_{large // 10}")),
        ]


def _line(what: str, seen: list[Shown], busy: float) -> Line:
    # From the first frame of one tick to the first of another: how long the frame lasts
    # that is there when it starts, or when it ends, says nothing of the page.
    begins = [now for before, now in pairwise(seen) if now.tick != before.tick]
    first, last = begins[0], begins[-1]
    rate = (last.tick - first.tick) / (last.time - first.time) * 1000
    drawn = len(begins) / (last.tick - first.tick + 1)
    gaps = [after.time - before.time for before, after in pairwise(seen)]
    frames = 1000 / statistics.mean(gaps)
    work = busy / len(seen) * 1000
    return Line(
        f"replay in the page, {what}",
        f"{rate:.1f} ticks/s, {drawn:.0%} of them drawn",
        f"{frames:.1f} frames/s, {work:.1f} ms of work in each",
        f"{_SPEED} ticks/s",
        rate >= 0.98 * _SPEED,
        {
            "ticks_per_second": rate,
            "drawn": drawn,
            "frames_per_second": frames,
            "longest_ms": max(gaps),
            "work_ms": work,
        },
    )


@contextmanager
def _walks(ticks: int, *sizes: int) -> Iterator[list[Path]]:
    """Record readings of so many sensors each, which are there within the block.

    Raises:
        FileNotFoundError: There is no Chromium to show them.
    """
    if chromium() is None:
        raise FileNotFoundError(NO_BROWSER)
    with tempfile.TemporaryDirectory() as folder:
        yield [_walk(Path(folder), sensors, ticks) for sensors in sizes]


def _walk(folder: Path, sensors: int, ticks: int) -> Path:
    """Record readings of five chains of thresholds, each of a walk of its own."""
    log = folder / f"{sensors}.mcap"
    run_once(replace(line_options(sensors, ticks, folder, 5), cells="inline"), log)
    return log


async def _played(what: str, log: Path, link: str = "") -> Line:
    """Play a recording in a browser.

    Args:
        what: What the table calls it.
        log: What to play.
        link: What else the address says.
    """
    async with serving(ViewSession(log)) as address, browsing() as opened:
        await opened.goto(f"{address.url}#t={_WARM}{link}")
        await wait_shown(opened, _WARM)
        session = await opened.context.new_cdp_session(opened)
        await session.send("Performance.enable")
        before = await _busy(session)
        shown = [Shown(*frame) for frame in await opened.evaluate(_PLAY, _SPEED)]
        return _line(what, shown, await _busy(session) - before)


async def _busy(session: CDPSession) -> float:
    """Return for how many seconds the page's own thread has worked so far."""
    found = await session.send("Performance.getMetrics")
    metrics = {metric["name"]: metric["value"] for metric in found["metrics"]}
    return float(metrics["TaskDuration"])


def seek(sizes: Sizes) -> list[Line]:
    """Go to ticks far from any that was looked at, each in a server of its own."""
    crowds, last = (sizes.crowd, 4 * sizes.crowd), sizes.ticks
    ticks = (last, last // 2, last * 3 // 4)
    with _walks(last, *crowds) as logs:
        return [
            _seek_line(sensors, [asyncio.run(_sought(log, tick)) for tick in ticks])
            for sensors, log in zip(crowds, logs, strict=True)
        ]


def _seek_line(sensors: int, times: list[float]) -> Line:
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
