"""The interface of a figure: its table entries, and what is drawn from them.

To add one, write a module with a `Figure` and put it into
`neurosnap.apps.figures.run.FIGURES`. Its entries may be anything that is an
`neurosnap.apps.figures.experiments.entry.Entry`; its report says what goes into the
CSV, the picture and the JSON.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments.entry import Entry
from neurosnap.apps.figures.experiments.learning_error import TruthKind

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


STEPS = 8000
"""Observations in each run of the paper, and so in each by default."""


class FigureOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What all figures are made with."""

    only: tuple[str, ...] = ()
    """Which figures, by name or by number from 1; empty: all."""
    runs: Annotated[int, msgspec.Meta(ge=1)] = 50
    """Runs of every learner in every setting."""
    steps: Annotated[int, msgspec.Meta(ge=1)] = STEPS
    """Observations in each."""
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] = 0
    """Draws the walks."""
    truth: TruthKind = "contained"
    """What learned graphs are compared with: the true containments, or the walk's own
    stationary weights and the learner's threshold."""
    equivalences: bool = False
    """Whether learned graphs have their equivalences."""
    workers: Annotated[int, msgspec.Meta(ge=1)] = 2
    """Threads that compute; they change no result."""
    homes: Path | None = None
    """A folder of recorded homes, ``NAME.sensors``; None: that figure is left out."""
    alarms: str = "1/week"
    """The budget of alarms in those homes."""
    out: Path = Path("figures")
    """Where all of it goes; finished cells into the folder ``cells`` of it."""


class Claim(msgspec.Struct, frozen=True):
    """One thing the paper says of a figure, held against the data."""

    says: str
    """What the paper says, and how it was made a question of numbers."""
    holds: bool | None
    """The answer; None: there are too few steps to judge."""
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
    """What one figure has to show."""

    columns: tuple[str, ...]
    """The names of the columns of its CSV."""
    rows: Iterable[Sequence[object]]
    """The rows of its CSV; read once."""
    draw: Callable[["Canvas"], None]
    """Draws on an empty canvas."""
    claims: tuple[Claim, ...]
    """What the paper says of it."""
    facts: dict[str, Any]
    """What else belongs into its JSON: fits and the like."""
    lines: tuple[str, ...]
    """The same facts for people to read, a line each."""


@dataclass(frozen=True)
class Figure:
    """A figure: what it needs, and what is made of that."""

    name: str
    """Its files are called so."""
    title: str
    """What it shows, in a few words."""
    cells: Callable[[FigureOptions], Sequence[Entry]]
    """Returns the cells it is made of."""
    report: Callable[[FigureOptions, Sequence[NDArray[Any]]], Report]
    """Takes the rows of those cells, in the same order."""


def judged(claims: Sequence[Claim], steps: int) -> tuple[Claim, ...]:
    """Return the claims, those undecided for which so many steps are too few."""
    return tuple(
        msgspec.structs.replace(claim, holds=None) if steps < claim.steps else claim
        for claim in claims
    )


def agreement(claims: Sequence[Claim]) -> str:
    """Return how a figure agrees or disagrees with the paper, in one line."""
    if not claims:
        return "the paper says nothing of this that could be held against it"
    held = sum(claim.holds is True for claim in claims)
    each = "; ".join(
        f"{claim.verdict}: {claim.says} ({claim.numbers})" for claim in claims
    )
    return f"{held} of {len(claims)} claims hold. {each}"
