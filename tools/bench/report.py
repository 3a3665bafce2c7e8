"""What a benchmark hands in: lines of a table, with the bare figures beside."""

import os
import platform
import statistics
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field

from rich.table import Table

_HEAD = ("what", "measured", "against", "reach", "")
_SHARES = (3, 4, 4, 3, 0)  # of the screen's width
_MARKS = {True: "✓", False: "✗", None: ""}


@dataclass(frozen=True)
class Sizes:
    """How much is measured."""

    cells: int = 1000
    """Processes of the spawn row."""
    chain: int = 200
    """Edges on the longest chain, for hop and line."""
    heights: tuple[int, ...] = (2, 5, 10, 20, 50, 100, 150, 200)
    """Chains of the line row."""
    waves: int = 30
    """Waves timed at each height, and laps of the bare ring."""
    pairs: int = 3
    """Times that a pair of sides is measured, interleaved."""
    ticks: int = 300
    """Ticks of a run."""
    sensors: tuple[int, ...] = (145, 1000)
    """Sensors of the observe row."""
    waved: tuple[int, ...] = (100, 300, 1000)
    """Cells of the wave row."""
    lines: tuple[int, ...] = (20, 100, 300, 1000)
    """Sensors of the kinds row."""
    crowds: tuple[int, ...] = (1000, 3000, 10_000)
    """Sensors of the coordinator and lazy rows."""
    fitted: tuple[int, ...] = (100, 1000, 3000, 10_000)
    """Sensors of the runs that a model of a tick is made of."""
    foretold: tuple[int, ...] = (300, 600, 2000, 4500, 7000)
    """Sensors of the runs that it is held against."""
    crowd: int = 500
    """Sensors of the page row: more than it draws each by itself unless asked to."""
    batches: int = 9
    """Times that a batch of observations is timed."""


QUICK = Sizes(
    cells=20,
    chain=20,
    heights=(2, 5, 10, 20),
    waves=5,
    pairs=1,
    ticks=20,
    sensors=(20, 40),
    waved=(20,),
    lines=(20,),
    crowds=(40,),
    fitted=(40, 60, 80),
    foretold=(70,),
    crowd=170,
    batches=2,
)
"""Enough to see that each row works; what is measured means nothing."""


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    what: str
    """What was measured."""
    measured: str
    """The outcome, in words."""
    against: str = ""
    """What it is compared with, in words."""
    reach: str = ""
    """What it should come to."""
    reached: bool | None = None
    """Whether it does; None where nothing was set."""
    figures: dict[str, float] = field(default_factory=dict)
    """The plain numbers: seconds, bytes, ratios."""

    def cells(self) -> tuple[str, ...]:
        """Return what stands in the table."""
        mark = _MARKS[self.reached]
        return (self.what, self.measured, self.against, self.reach, mark)


def ratio_of_pairs(ours: list[float], theirs: list[float]) -> float:
    """Return the median ratio of neighbours: both sides saw the same machine."""
    return statistics.median(a / b for a, b in zip(ours, theirs, strict=True))


def table(lines: Iterable[Line], *, head: bool = True) -> Table:
    """Return the lines as a table for the screen, as wide as that.

    Args:
        lines: What it shows.
        head: Whether it says what stands in its columns; those of others below it are
            as wide.
    """
    shown = Table(expand=True, show_header=head)
    for name, share in zip(_HEAD, _SHARES, strict=True):
        if share:
            shown.add_column(name, ratio=share)
        else:
            shown.add_column(name, width=1)
    for line in lines:
        shown.add_row(*line.cells())
    return shown


def markdown_head() -> str:
    """Return what a Markdown table begins with."""
    return "\n".join(_row(cells) for cells in (_HEAD, ("---",) * len(_HEAD)))


def markdown(lines: Iterable[Line]) -> str:
    """Return the lines as those of a Markdown table."""
    return "\n".join(_row(line.cells()) for line in lines)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def as_json(rows: dict[str, list[Line]]) -> dict[str, object]:
    """Return everything, plain, with what it was measured on."""
    return {
        "machine": {
            "cores": len(os.sched_getaffinity(0)),
            "load": os.getloadavg()[0],
            "platform": platform.platform(),
            "python": ".".join(map(str, sys.version_info[:3])),
        },
        "rows": {
            name: [asdict(line) for line in lines] for name, lines in rows.items()
        },
    }
