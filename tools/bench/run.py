"""Rows on whole runs of the path: what recording costs, how fast a replay checks."""

import asyncio
import tempfile
from pathlib import Path

from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.verify import verify as replay
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.request import Outcome, RunRequest
from neurosnap.runtime.run import run
from neurosnap.sources.open import open_source
from tools.bench.report import Line, Sizes, ratio_of_pairs

_SOURCE = "neurosnap/Path-v0"
_RECORDING, _VERIFY = 1.15, 10.0


def recording(sizes: Sizes) -> list[Line]:
    """Time a tick with the recorder on and off, in turns."""
    options = path_options(sizes.ticks)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        run_once(path_options(5), None)
        off, on, whole, messages = [], [], True, 0
        for turn in range(sizes.pairs):
            off.append(run_once(options, None).seconds)
            recorded = run_once(options, Path(folder) / f"{turn}.mcap")
            on.append(recorded.seconds)
            if recorded.completeness is None:
                raise RuntimeError("recording: must have a balance")
            whole &= recorded.completeness.whole
            messages = recorded.completeness.messages
    ratio = min(on) / min(off)
    tick, bare = min(on) / sizes.ticks, min(off) / sizes.ticks
    return [
        Line(
            f"a tick, recorded ({len(options.sensors)} sensors, {sizes.ticks} ticks)",
            f"{tick * 1e3:.1f} ms ({ratio:.2f} ×), {messages:,} messages,"
            f" {'whole' if whole else 'NOT whole'}",
            f"not recorded {bare * 1e3:.1f} ms",
            f"≤ {_RECORDING:g} ×, whole",
            ratio <= _RECORDING and whole,
            {
                "seconds": tick,
                "bare_seconds": bare,
                "ratio": ratio,
                "ratio_of_pairs": ratio_of_pairs(on, off),
                "messages": messages,
                "whole": whole,
            },
        )
    ]


def verify(sizes: Sizes) -> list[Line]:
    """Time `replay --verify` against the run whose recording it checks."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        log = Path(folder) / "run.mcap"
        made = run_once(path_options(sizes.ticks), log)
        verdicts = [replay(log) for _ in range(sizes.pairs + 1)][1:]
    best = min(verdict.seconds for verdict in verdicts)
    ticks, same = verdicts[0].ticks, all(verdict.same for verdict in verdicts)
    speed = made.seconds / made.totals.ticks / (best / ticks)
    return [
        Line(
            f"replay --verify of {ticks} ticks",
            f"{ticks / best:,.0f} ticks/s ({speed:.0f} ×),"
            f" {'same' if same else 'NOT the same'}",
            f"the run {made.totals.ticks / made.seconds:,.0f} ticks/s",
            f"≥ {_VERIFY:g} ×, same",
            speed >= _VERIFY and same,
            {
                "seconds": best,
                "run_seconds": made.seconds,
                "ticks": ticks,
                "speed": speed,
                "same": same,
            },
        )
    ]


def path_options(ticks: int) -> RunOptions:
    """Return the run of a walker on the path."""
    source = open_source(_SOURCE, 0)
    source.close()
    return RunOptions(source=_SOURCE, body=body_of(source, "walker"), ticks=ticks)


def run_once(options: RunOptions, log: Path | None = None) -> Outcome:
    """Make a run; None: not recorded."""

    async def once() -> Outcome:
        return await run(RunRequest(options, log), asyncio.Event())

    return asyncio.run(once())
