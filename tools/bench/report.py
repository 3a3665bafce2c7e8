"""Problem sizes of the benchmarks, and the rows of their result table."""

import statistics
from collections.abc import Iterable
from dataclasses import dataclass, field

HEAD = ("what", "measured", "against", "reach", "")
_MARKS = {True: "✓", False: "✗", None: ""}


@dataclass(frozen=True)
class Sizes:
    """How much is measured."""

    cells: int = 1000
    """Processes of the spawn row."""
    chain: int = 200
    """Cells of the chain of the hop row."""
    waves: int = 30
    """Waves timed at each height, and laps of the bare ring."""
    pairs: int = 3
    """Times that a pair of sides is measured, interleaved."""
    ticks: int = 300
    """Ticks of a run."""
    sensors: tuple[int, ...] = (145, 1000)
    """Sensors of the observe row."""
    lines: tuple[int, ...] = (20, 100, 300, 1000)
    """Sensors of the kinds row."""
    swarms: tuple[int, ...] = (20, 100, 300)
    """Cells of the tick row."""
    fitted: tuple[tuple[int, int], ...] = (
        (100, 1),
        (1000, 1),
        (1000, 10),
        (1000, 50),
        (3000, 1),
        (3000, 20),
        (3000, 100),
        (10_000, 1),
        (10_000, 20),
        (10_000, 150),
    )
    """Sensors and walkers of the runs that a model of a tick is made of."""
    foretold: tuple[tuple[int, int], ...] = (
        (300, 1),
        (2000, 5),
        (4500, 50),
        (7000, 1),
        (7000, 100),
    )
    """Sensors and walkers of the runs that it is held against."""
    paces: tuple[int, ...] = (10_000, 43_000)
    """Sensors of the runs that are timed."""
    crowd: int = 500
    """Sensors of the page row: more than it draws each by itself unless asked to."""
    bag: int = 10**9
    """Bytes of a bag."""
    field: float = 10.0
    """Seconds for which a run is fed from outside."""
    batches: int = 9
    """Times that a batch of observations is timed."""


QUICK = Sizes(
    cells=20,
    chain=20,
    waves=5,
    pairs=1,
    ticks=20,
    sensors=(20, 40),
    lines=(20,),
    swarms=(20,),
    fitted=((40, 1), (60, 1), (60, 4), (80, 1)),
    foretold=((70, 2),),
    paces=(50,),
    crowd=170,
    bag=10**6,
    field=2.0,
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


def markdown(cells: Iterable[str]) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(cells)} |"
