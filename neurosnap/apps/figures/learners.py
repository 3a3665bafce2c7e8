"""Learners, data and lines that the three learning figures share."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.curves import Curve, Rate, fitted
from neurosnap.apps.figures.experiments.learning_error import LearningEntry
from neurosnap.apps.figures.experiments.walks import SETTINGS
from neurosnap.apps.figures.figure import Claim, FigureOptions, Report

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

LETTERS = {setting.name: setting.letter for setting in SETTINGS}
"""What the paper calls each setting."""

COLUMNS = ("setting", "threshold", "decay", "step", "mean", "std", "min", "max")


def learner(
    options: FigureOptions, setting: str, threshold: float, decay: float | None = None
) -> LearningEntry:
    """Return a learner in a setting, under the options of a figure."""
    return LearningEntry(
        setting=setting,
        threshold=threshold,
        decay=decay,
        truth=options.truth,
        equivalences=options.equivalences,
        runs=options.runs,
        steps=options.steps,
        seed=options.seed,
    )


def empirical(options: FigureOptions) -> list[LearningEntry]:
    """Return an empirical learner a setting and threshold, settings outermost."""
    return [learner(options, s.name, tau) for s in SETTINGS for tau in THRESHOLDS]


def discounted(options: FigureOptions) -> list[LearningEntry]:
    """Return a discounted learner a setting and decay, settings outermost."""
    return [learner(options, s.name, LEAST, q) for s in SETTINGS for q in DECAYS]


def curves_of(
    cells: Sequence[LearningEntry], rows: Sequence[NDArray[Any]]
) -> list[Curve]:
    """Return the curve of each cell, of its rows."""
    return [Curve.of(*pair) for pair in zip(cells, rows, strict=True)]


def report(
    curves: Sequence[Curve],
    draw: Callable[["Canvas", Sequence[Curve]], None],
    claims: tuple[Claim, ...],
) -> Report:
    """Return a figure of curves.

    Args:
        curves: What it shows.
        draw: Draws them on an empty canvas.
        claims: What the paper says of them.
    """
    fits = rates(curves)
    return Report(
        columns=COLUMNS,
        rows=table_rows(curves),
        draw=lambda canvas: draw(canvas, curves),
        claims=claims,
        facts=facts(fits),
        lines=lines(fits),
    )


def by_setting(curves: Sequence[Curve]) -> dict[str, list[Curve]]:
    """Return the curves of each setting, in order."""
    return {
        s.name: [curve for curve in curves if curve.cell.setting == s.name]
        for s in SETTINGS
    }


def table_rows(curves: Sequence[Curve]) -> Iterator[Sequence[object]]:
    """Yield a row of `COLUMNS` for each step of each curve.

    A decay is empty where there is none; means and spreads have six figures.
    """
    for curve in curves:
        head = (
            curve.cell.setting,
            repr(curve.cell.threshold),
            "" if curve.cell.decay is None else repr(curve.cell.decay),
        )
        columns = zip(
            curve.mean.tolist(),
            curve.std.tolist(),
            curve.least.tolist(),
            curve.most.tolist(),
            strict=True,
        )
        for step, (mean, std, least, most) in enumerate(columns, 1):
            yield *head, step, f"{mean:.6g}", f"{std:.6g}", least, most


def rates(curves: Sequence[Curve]) -> list[tuple[Curve, Rate | None]]:
    """Return each curve with its fitted rate."""
    return [(curve, fitted(curve)) for curve in curves]


def facts(fits: Sequence[tuple[Curve, Rate | None]]) -> dict[str, Any]:
    """Return what a figure's JSON says of its curves."""
    return {
        "curves": [
            {
                "setting": curve.cell.setting,
                "threshold": curve.cell.threshold,
                "decay": curve.cell.decay,
                "level": curve.level,
                "last": float(curve.mean[-1]),
                "halved": curve.halved,
                "fit": None if rate is None else msgspec.to_builtins(rate),
            }
            for curve, rate in fits
        ]
    }


def lines(fits: Sequence[tuple[Curve, Rate | None]]) -> tuple[str, ...]:
    """Return a line for people a curve: its rate, and where it has come to."""
    return tuple(
        f"{_named(curve):<40} {_said(rate):<58} level {curve.level:.4g}"
        for curve, rate in fits
    )


def _named(curve: Curve) -> str:
    cell = curve.cell
    decay = "" if cell.decay is None else f", 1 - q = 1/{1 / (1 - cell.decay):g}"
    return f"{cell.setting}, τ = {cell.threshold:.4g}{decay}"


def _said(rate: Rate | None) -> str:
    if rate is None:
        return "does not decay exponentially"
    return (
        f"{rate.rate:.3g} a step, half-life {rate.half_life:.0f}, R² {rate.r2:.3f},"
        f" steps {rate.first}–{rate.last}"
    )
