"""The interface of a figure: its table entries, and how their rows are drawn.

To add one, write a module with a `Figure` and put it into `tools.paper.run.FIGURES`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from tools.paper.table import Entry

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

TruthKind: TypeAlias = Literal["contained", "thresholded"]

STEPS = 8000
"""Observations in each run of the paper, and so in each by default."""


class FigureOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What all figures are made with."""

    only: tuple[str, ...] = ()
    """Which figures, by name; empty: all."""
    runs: int = 50
    """Runs of every learner in every setting."""
    steps: int = STEPS
    """Observations in each."""
    seed: int = 0
    """Draws the walks."""
    truth: TruthKind = "contained"
    """What learned graphs are compared with: the true containments, or the walk's own
    stationary weights and the learner's threshold."""
    workers: int = 2
    """Processes that compute; they change no result."""
    homes: Path | None = None
    """A folder of recorded homes; None: their figure is left out."""
    alarms: str = "1/week"
    """The budget of alarms in those homes."""
    out: Path = Path("figures")
    """Where all of it goes; finished entries into the folder ``cells`` of it."""


class Claim(msgspec.Struct, frozen=True):
    """One thing the paper says of a figure, held against the data."""

    says: str
    """What the paper says, and how it was made a question of numbers."""
    holds: bool | None
    """The answer; None if there are too few steps to judge."""
    numbers: str
    """The numbers it was decided by."""
    steps: int = STEPS
    """How many observations in a run it takes to judge it."""

    @property
    def verdict(self) -> str:
        """Whether it holds, in words."""
        if self.holds is None:
            return f"too few steps to judge (it takes {self.steps:,})"
        return "holds" if self.holds else "does not hold"


@dataclass(frozen=True)
class Report:
    """The contents of one figure: its rows, its facts, its claims, its picture."""

    columns: tuple[str, ...]
    """The names of the columns of its CSV."""
    rows: Iterable[Sequence[object]]
    """The rows of its CSV; read once."""
    lines: tuple[str, ...]
    """Its facts for people to read, a line each."""
    claims: tuple[Claim, ...] = ()
    """What the paper says of it."""
    draw: Callable[["Canvas"], None] | None = None
    """Draws on an empty canvas; None if there is no picture."""


@dataclass(frozen=True)
class Figure:
    """A figure: what it needs, and what is made of that."""

    name: str
    """Its files are called so."""
    title: str
    """What it shows, in a few words."""
    cells: Callable[[FigureOptions], Sequence[Entry]]
    """Returns the entries it is made of."""
    report: Callable[[FigureOptions, Sequence[NDArray[Any]]], Report]
    """Takes the rows of those entries, in the same order."""


STEPWISE = ("step", "mean", "std", "min", "max")
"""The columns that `stepwise` gives the numbers of."""


def stepwise(
    heads: Iterable[tuple[object, ...]], entries: Iterable[NDArray[Any]]
) -> Iterator[Sequence[object]]:
    """Yield a row of a CSV for each step of each entry, over its runs.

    Means and spreads have six figures.

    Args:
        heads: What the rows of an entry begin with.
        entries: The entries, ``(runs, steps)`` each.
    """
    for head, rows in zip(heads, entries, strict=True):
        numbers = (of(rows, axis=0) for of in (np.mean, np.std, np.min, np.max))
        columns = zip(*(column.tolist() for column in numbers), strict=True)
        for step, (mean, std, least, most) in enumerate(columns, 1):
            yield *head, step, f"{mean:.6g}", f"{std:.6g}", least, most


def markdown(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> tuple[str, ...]:
    """Return the lines of a Markdown table for people."""
    lines = (columns, ("---",) * len(columns), *rows)
    return tuple(f"| {' | '.join(line)} |" for line in lines)


def judged(claims: Sequence[Claim], steps: int) -> tuple[Claim, ...]:
    """Return the claims, those undecided for which so many steps are too few."""
    return tuple(
        msgspec.structs.replace(claim, holds=None) if steps < claim.steps else claim
        for claim in claims
    )
