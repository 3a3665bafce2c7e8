"""Learners, data and lines that the learning figures share."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tools.paper.curves import Curve, fitted
from tools.paper.figure import STEPWISE, Claim, FigureOptions, Report, stepwise
from tools.paper.learning_error import LearningEntry
from tools.paper.plots import Scale, Stroke, draw, shades
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
        found[cell.setting].append(Curve(cell, row))
    return found


def report(
    curves: dict[str, list[Curve]],
    claims: tuple[Claim, ...],
    title: str,
    labels: Sequence[str],
    scale: Scale,
) -> Report:
    """Return a figure of curves.

    Args:
        curves: What it shows, by setting.
        claims: What the paper says of them.
        title: Of the picture, without the number of walks.
        labels: What each of a setting's curves is called in it.
        scale: Of its steps.
    """
    every = [curve for chosen in curves.values() for curve in chosen]
    runs = every[0].cell.runs

    def draw_on(canvas: "Canvas") -> None:
        strokes = [
            Stroke(name, label, colour, curve.rows)
            for name, chosen in curves.items()
            for curve, label, colour in zip(
                chosen, labels, shades(len(labels)), strict=True
            )
        ]
        # An edge never comes without its contrapositive: a mean is 0, or this at least.
        what, least = "Err(t), mean of runs (edges)", 2 / runs
        draw(canvas, strokes, f"{title}, {runs} random walks", what, least, scale)

    # A decay is empty where there is none.
    heads = [
        (
            c.cell.setting,
            repr(c.cell.threshold),
            "" if c.cell.decay is None else repr(c.cell.decay),
        )
        for c in every
    ]
    return Report(
        columns=("setting", "threshold", "decay", *STEPWISE),
        rows=stepwise(heads, [curve.rows for curve in every]),
        draw=draw_on,
        claims=claims,
        lines=tuple(_line(curve) for curve in every),
    )


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
