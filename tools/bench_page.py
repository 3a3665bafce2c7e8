"""The row on the page: ticks it shows a second, without a graphics card."""

import asyncio
import random
import statistics
import tempfile
from itertools import pairwise
from pathlib import Path

from neurosnap.agent.context import Body
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.run import run
from neurosnap.view.desk import Desk
from neurosnap.view.server import serving
from tools.bench_report import Line, Sizes
from tools.screenshots import browsing

_SPEED = 60
_WARM = 10  # ticks learned before the clock starts: the first orders are large
_PLAY = """async (first) => {
    const { page } = await import("/main.js");
    page.player.step(first - page.player.tick);
    while (page.frame?.tick !== first) await new Promise(requestAnimationFrame);
    page.player.setSpeed(SPEED);
    page.player.play();
    const seen = [];
    while (page.player.playing) {
        seen.push([await new Promise(requestAnimationFrame), page.frame.tick]);
    }
    return seen;
}""".replace("SPEED", str(_SPEED))


def page(sizes: Sizes) -> list[Line]:
    """Play a recording at sixty ticks a second, and time the browser's frames."""
    with tempfile.TemporaryDirectory() as folder:
        log = asyncio.run(_recorded(Path(folder), sizes.sensors[0], sizes.ticks))
        seen = asyncio.run(_played(log))
    times = [time for time, _ in seen]
    ticks = [tick for _, tick in seen]
    rate = (ticks[-1] - ticks[0]) / (times[-1] - times[0]) * 1000
    shown = len(set(ticks)) / (ticks[-1] - ticks[0] + 1)
    median = statistics.median(after - before for before, after in pairwise(times))
    return [
        Line(
            f"replay in the page, {sizes.sensors[0]} sensors",
            f"{rate:.1f} ticks/s, {shown:.0%} of them drawn",
            f"{median:.1f} ms a frame",
            f"{_SPEED} ticks/s",
            rate >= 0.98 * _SPEED,
            {"ticks_per_second": rate, "drawn": shown, "frame_ms": median},
        )
    ]


async def _recorded(folder: Path, sensors: int, ticks: int) -> Path:
    """Record readings of five chains of thresholds, each of a walk of its own."""
    chance = random.Random(0)
    names = [f"w{k % 5}_below_{k // 5}" for k in range(sensors)]
    places = [sensors // 10] * 5
    lines = [",".join(names)]
    for _ in range(ticks):
        places = [x + chance.choice((-1, 0, 1)) for x in places]
        lines.append(",".join(f"{places[k % 5] < k // 5:d}" for k in range(sensors)))
    readings = folder / "readings.csv"
    readings.write_text("\n".join(lines) + "\n", encoding="utf-8")
    options = RunOptions(
        source=str(readings), body=Body(own=tuple(names)), ticks=ticks, cells="inline"
    )
    await run(options, folder / "log.mcap", asyncio.Event())
    return folder / "log.mcap"


async def _played(log: Path) -> list[tuple[float, int]]:
    """Return when each of the browser's frames came, and the tick it showed."""
    async with serving(Desk(log)) as address, browsing() as opened:
        await opened.goto(address.url)
        await opened.wait_for_selector("#drawing[data-tick]", state="attached")
        seen: list[tuple[float, int]] = await opened.evaluate(_PLAY, _WARM)
    return seen
