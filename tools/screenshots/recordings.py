"""Reproducible recordings for the pictures of the page."""

import csv
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

_EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
_PATH = "neurosnap/Path-v0 --set places=9 --agent planner --target below_1 --ticks 240"
_LAKE = (
    "neurosnap/FrozenLake-v0 --set senses_reward=true --agent planner --target rewarded"
    " --set agent.imagine=2000 --set agent.grow=30 --set agent.explore=planned"
    " --ticks 600 --set recording.frames=1"
)
_SLIPPERY = (
    "neurosnap/FrozenLake-v0 --set is_slippery=true --agent planner --target tile=goal"
    " --set agent.imagine=200 --set agent.grow=30 --set agent.explore=0.3 --ticks 900"
    " --set recording.frames=1"
)
_SILENT = ("power", "green")
"""Sensors that say nothing at every other tick of the end."""
_FROM = 300
"""Where that begins."""


def recorded(name: str, folder: Path) -> Path:
    """Record a run in a folder, unless it is there.

    Args:
        name: One of `RECORDINGS`.
        folder: Where it goes.

    Raises:
        RuntimeError: The run failed; with what it said.
    """
    log = folder / f"{name}.mcap"
    if not log.exists():
        command = Path(sys.executable).with_name("neurosnap")
        arguments = RECORDINGS[name](folder).split()
        # The page names the source: a path would be this machine's.
        run = [str(command), "run", *arguments, "--cells", "inline", "--out", log.name]
        ended = subprocess.run(
            run, check=False, capture_output=True, text=True, cwd=folder
        )
        if ended.returncode:
            raise RuntimeError(f"{' '.join(run)}: {ended.stderr}")
    return log


def _packing(folder: Path) -> str:
    """Write the readings of the packing line, with sensors that are silent at times."""
    with (_EXAMPLES / "readings.csv").open(encoding="utf-8", newline="") as file:
        heads, *rows = csv.reader(file)
    silent = [heads.index(name) for name in _SILENT]
    for row in rows[_FROM::2]:
        for place in silent:
            row[place] = ""
    return _written(folder / "packing.csv", [heads, *rows])


def _crowd(folder: Path) -> str:
    """Write readings of twenty rooms with 25 thresholds each, near one another."""
    chance = random.Random(5)
    rooms, levels = range(20), range(25)
    rows = [[f"room{room:02d}_below_{level}" for room in rooms for level in levels]]
    for _ in range(160):
        middle = chance.randrange(26)
        at = [middle + chance.randrange(-6, 7) for _ in rooms]
        rows.append([f"{at[room] <= level:d}" for room in rooms for level in levels])
    return _written(folder / "crowd.csv", rows)


def _written(path: Path, rows: list[list[str]]) -> str:
    """Write a table, and return the name of its file."""
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return path.name


RECORDINGS: dict[str, Callable[[Path], str]] = {
    "path": lambda _: f"{_PATH} --seed 2",
    "path-lax": lambda _: f"{_PATH} --seed 2 --threshold 0.1",
    "packing": _packing,
    "crowd": lambda folder: f"{_crowd(folder)} --threshold 0.02",
    "lake": lambda _: f"{_LAKE} --seed 1",
    "slippery": lambda _: f"{_SLIPPERY} --seed 1",
}
"""What `neurosnap run` is asked for, by name; some write their readings first."""
