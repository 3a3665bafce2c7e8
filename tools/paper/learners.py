"""Learners, data and lines that the learning figures share."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tools.paper.curves import Curve, fitted
from tools.paper.figure import Claim, FigureOptions, Report
from tools.paper.learning_error import LearningEntry
from tools.paper.walks import SETTINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

SENSORS = 20
"""Of every setting."""

THRESHOLDS = tuple(np.linspace(1 / SENSORS**3, 1 / 4, 10).tolist())
"""``tau`` of the empirical learners ([GK] empirical:performance)."""

LEAST = THRESHOLDS[0]
"""The threshold of discounted learners: the paper gives it for the comparison only."""

DECAYS = tuple(1 - 2.0 ** -(k + 2) for k in range(10))
"""``q`` of the discounted learners, for ``k`` from 0 ([GK] discounted:performance)."""

COLUMNS = ("setting", "threshold", "decay", "step", "mean", "std", "min", "max")


def learners(options: FigureOptions, *, discounted: bool) -> list[LearningEntry]:
    """Return a learner a setting and threshold, or decay; settings outermost."""
    kinds: list[tuple[float, float | None]] = [(tau, None) for tau in THRESHOLDS]
    if discounted:
        kinds = [(LEAST, q) for q in DECAYS]
    return [
        LearningEntry(
            setting=setting,
            threshold=threshold,
            decay=decay,
            truth=options.truth,
            runs=options.runs,
            steps=options.steps,
            seed=options.seed,
        )
        for setting in SETTINGS
        for threshold, decay in kinds
    ]


def curves_of(
    cells: Sequence[LearningEntry], rows: Sequence[NDArray[Any]]
) -> dict[str, list[Curve]]:
    """Return the curves of each setting, in order."""
    found: dict[str, list[Curve]] = {name: [] for name in SETTINGS}
    for cell, row in zip(cells, rows, strict=True):
        found[cell.setting].append(Curve.of(cell, row))
    return found


def report(
    curves: dict[str, list[Curve]],
    draw: Callable[["Canvas", Sequence[Curve]], None],
    claims: tuple[Claim, ...],
) -> Report:
    """Return a figure of curves.

    Args:
        curves: What it shows, by setting.
        draw: Draws them on an empty canvas.
        claims: What the paper says of them.
    """
    every = [curve for chosen in curves.values() for curve in chosen]
    return Report(
        columns=COLUMNS,
        rows=_rows(every),
        draw=lambda canvas: draw(canvas, every),
        claims=claims,
        lines=tuple(_line(curve) for curve in every),
    )


def _rows(curves: Sequence[Curve]) -> Iterator[Sequence[object]]:
    """Yield a row of `COLUMNS` for each step of each curve.

    A decay is empty where there is none; means and spreads have six figures.
    """
    for curve in curves:
        cell = curve.cell
        decay = "" if cell.decay is None else repr(cell.decay)
        columns = (curve.mean, curve.std, curve.least, curve.most)
        values = zip(*(column.tolist() for column in columns), strict=True)
        for step, (mean, std, least, most) in enumerate(values, 1):
            head = cell.setting, repr(cell.threshold), decay, step
            yield *head, f"{mean:.6g}", f"{std:.6g}", least, most


def _line(curve: Curve) -> str:
    """Return a line for people: a curve's rate, and where it has come to."""
    cell, rate = curve.cell, fitted(curve)
    decay = "" if cell.decay is None else f", 1 - q = 1/{1 / (1 - cell.decay):g}"
    said = "does not decay exponentially"
    if rate is not None:
        said = (
            f"{rate.rate:.3g} a step, half-life {rate.half_life:.0f}, R² {rate.r2:.3f},"
            f" steps {rate.first}–{rate.last}"
        )
    named = f"{cell.setting}, τ = {cell.threshold:.4g}{decay}"
    return f"{named:<40} {said:<58} level {curve.level:.4g}"
