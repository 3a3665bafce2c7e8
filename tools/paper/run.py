"""Runs the experiments: computes missing entries and writes complete figures.

In the output folder every figure has its data (``NAME.csv``), and some a picture
(``.png``, ``.svg``, ``.pdf``), each written whole or not at all.
"""

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from neurosnap.errors import InvalidValueError
from neurosnap.system.durable import replace_file
from neurosnap.system.picture import KINDS, canvas_type, encoded
from tools.paper import (
    fig1_empirical,
    fig2_discounted,
    fig4_excitation,
    fig5_obstructions,
    fig7_growth,
    fig8_homes,
    fig9_robot,
)
from tools.paper.figure import Claim, Figure, FigureOptions, Report, judged
from tools.paper.table import Table

if TYPE_CHECKING:
    from tools.paper.table import Entry

FIGURES: dict[str, Figure] = {
    figure.name: figure
    for figure in (
        fig1_empirical.FIGURE,
        fig2_discounted.FIGURE,
        fig4_excitation.FIGURE,
        fig5_obstructions.FIGURE,
        fig7_growth.FIGURE,
        fig8_homes.FIGURE,
        fig9_robot.FIGURE,
    )
}
"""All figures by name."""


class FigureResult(NamedTuple):
    """One figure that was made."""

    title: str
    files: tuple[Path, ...]
    lines: tuple[str, ...]
    """Its facts for people, a line each."""
    claims: tuple[Claim, ...]
    """What the paper says of it, and whether it holds."""


def run_figures(
    options: FigureOptions,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[FigureResult]:
    """Make figures: entries that are there already are taken, the others computed.

    Args:
        options: What to make; all but `workers` and `only` is part of the results.
        on_progress: Told how many runs of how many are done.

    Raises:
        InvalidValueError: An option is out of range, or there is no such figure.
        MissingExtraError: matplotlib is not installed.
        OSError: The output folder cannot be written.
    """
    for name, least in (("runs", 1), ("steps", 1), ("workers", 0), ("seed", 0)):
        value = getattr(options, name)
        if value < least:
            raise InvalidValueError(name, f"must be at least {least}", value)
    canvas_type("figures")  # hours of computing must not end in a missing package
    chosen = _chosen(options)
    wanted: dict[str, Entry] = {}
    for figure in chosen:
        wanted.update((cell.key, cell) for cell in figure.cells(options))
    options.out.mkdir(parents=True, exist_ok=True)
    table = Table(options.out / "cells")
    table.fill(wanted.values(), options.workers, on_progress)
    return [_make(figure, options, table) for figure in chosen]


def _chosen(options: FigureOptions) -> list[Figure]:
    """Return the figures asked for, in their own order."""
    for name in options.only:
        if name not in FIGURES:
            raise InvalidValueError("only", f"must be of {', '.join(FIGURES)}", name)
    if options.only:
        return [figure for name, figure in FIGURES.items() if name in options.only]
    left = [fig9_robot.FIGURE]  # needs scikit-learn, and most of an hour
    if options.homes is None:
        left.append(fig8_homes.FIGURE)
    return [figure for figure in FIGURES.values() if figure not in left]


def _make(figure: Figure, options: FigureOptions, table: Table) -> FigureResult:
    """Write the files of a figure, all of whose entries are there."""
    rows = [table.load(cell) for cell in figure.cells(options)]
    report = figure.report(options, [each for each in rows if each is not None])
    claims = judged(report.claims, options.steps)
    contents = {**_pictures(report), "csv": _data(report)}
    files = tuple(options.out / f"{figure.name}.{kind}" for kind in contents)
    for path, content in zip(files, contents.values(), strict=True):
        replace_file(path, content)
    return FigureResult(figure.title, files, report.lines, claims)


def _pictures(report: Report) -> dict[str, bytes]:
    """Return the picture as files of all kinds."""
    if report.draw is None:
        return {}
    canvas = canvas_type("figures")(layout="constrained")
    report.draw(canvas)
    return {kind: encoded(canvas, kind) for kind in KINDS}


def _data(report: Report) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(report.columns)
    writer.writerows(report.rows)
    return text.getvalue().encode()
