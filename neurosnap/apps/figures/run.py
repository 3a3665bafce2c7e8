"""Runs the experiments: computes missing entries and draws complete figures.

In the output folder every figure has a picture, its data and its facts (``NAME.png``,
``.svg``, ``.pdf``; ``.csv``; ``.json``), each written whole or not at all.
"""

import csv
import io
import platform
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from neurosnap.apps.figures import (
    fig1_empirical,
    fig2_discounted,
    fig3_both_snapshots,
    fig4_excitation,
    fig5_obstructions,
    fig6_anomalies,
    fig7_growth,
    fig8_homes,
)
from neurosnap.apps.figures.figure import (
    Claim,
    Figure,
    FigureOptions,
    Report,
    agreement,
    judged,
)
from neurosnap.apps.figures.results_table import Table
from neurosnap.errors import InvalidValueError
from neurosnap.system.distribution import version
from neurosnap.system.durable import replace_file
from neurosnap.system.picture import KINDS, canvas_type, encoded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from neurosnap.apps.figures.experiments.entry import Entry

FIGURES: dict[str, Figure] = {
    figure.name: figure
    for figure in (
        fig1_empirical.FIGURE,
        fig2_discounted.FIGURE,
        fig3_both_snapshots.FIGURE,
        fig4_excitation.FIGURE,
        fig5_obstructions.FIGURE,
        fig6_anomalies.FIGURE,
        fig7_growth.FIGURE,
        fig8_homes.FIGURE,
    )
}
"""All figures by name; their order gives them their numbers, from 1."""


class FigureResult(msgspec.Struct, frozen=True):
    """One figure that was made."""

    name: str
    title: str
    files: tuple[Path, ...]
    """The picture as PNG, SVG and PDF, the data and the facts."""
    lines: tuple[str, ...]
    """Its facts for people, a line each."""
    claims: tuple[Claim, ...]
    """What the paper says of it, and whether it holds."""
    agreement: str
    """The same in one line."""


class FigureResults(msgspec.Struct, frozen=True):
    """What came of a call."""

    figures: tuple[FigureResult, ...]
    """Those whose cells are all there."""
    computed: int
    """Cells computed by this call."""
    reused: int
    """Cells that were there before."""
    missing: int
    """Cells that are still to be computed: it was cancelled."""


def run_figures(
    options: FigureOptions,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> FigureResults:
    """Make figures: cells that are there already are taken, the others computed.

    Args:
        options: What to make; all but `workers` and `only` is part of the results.
        on_progress: Told how many runs of how many are done; a run is one learner's
            walk, and those of cells that are reused are not counted.
        cancelled: Asked after every run whether to stop. Finished cells and the figures
            complete by then are kept; an interrupt keeps the cells, and goes on up.

    Returns:
        The figures that could be made, with files, and what is missing.

    Raises:
        InvalidValueError: An option is out of range, or there is no such figure.
        MissingExtraError: matplotlib is not installed.
        OSError: The output folder cannot be written.
    """
    _check(options)
    canvas_type("figures")  # hours of computing must not end in a missing package
    chosen = chosen_figures(options.only)
    if options.homes is None and not options.only:
        chosen = [figure for figure in chosen if figure is not fig8_homes.FIGURE]
    wanted: dict[str, Entry] = {}
    for figure in chosen:
        wanted.update((cell.key, cell) for cell in figure.cells(options))
    options.out.mkdir(parents=True, exist_ok=True)
    table = Table(options.out / "cells")
    left = table.missing(wanted.values())
    computed = table.fill(left, options.workers, on_progress, cancelled)
    made = [_make(figure, options, table) for figure in chosen]
    return FigureResults(
        figures=tuple(result for result in made if result is not None),
        computed=computed,
        reused=len(wanted) - len(left),
        missing=len(left) - computed,
    )


def chosen_figures(only: tuple[str, ...]) -> list[Figure]:
    """Return figures by name or number, in their own order; all for none.

    Raises:
        InvalidValueError: There is no such figure.
    """
    numbered = {str(number): name for number, name in enumerate(FIGURES, 1)}
    names = set()
    for each in only:
        name = numbered.get(each, each)
        if name not in FIGURES:
            rule = f"must be of {', '.join(FIGURES)} or 1..{len(FIGURES)}"
            raise InvalidValueError("only", rule, each)
        names.add(name)
    return [f for name, f in FIGURES.items() if name in names or not names]


def _check(options: FigureOptions) -> None:
    for name, least in (("runs", 1), ("steps", 1), ("workers", 1), ("seed", 0)):
        value = getattr(options, name)
        if value < least:
            raise InvalidValueError(name, f"must be at least {least}", value)
    if options.truth not in ("contained", "thresholded"):
        rule = 'must be "contained" or "thresholded"'
        raise InvalidValueError("truth", rule, options.truth)


def _make(figure: Figure, options: FigureOptions, table: Table) -> FigureResult | None:
    """Write the files of a figure; None if a cell of it is not there."""
    rows: list[NDArray[Any]] = []
    for cell in figure.cells(options):
        loaded = table.load(cell)
        if loaded is None:
            return None
        rows.append(loaded)
    report = figure.report(options, rows)
    claims = judged(report.claims, options.steps)
    report = replace(report, claims=claims)
    said = agreement(claims)
    contents = {
        **_pictures(report),
        "csv": _data(report),
        "json": _facts(figure, options, report, said),
    }
    files = tuple(options.out / f"{figure.name}.{kind}" for kind in contents)
    for path, content in zip(files, contents.values(), strict=True):
        replace_file(path, content)
    return FigureResult(figure.name, figure.title, files, report.lines, claims, said)


def _pictures(report: Report) -> dict[str, bytes]:
    """Return the picture as files of all kinds."""
    canvas = canvas_type("figures")(layout="constrained")
    report.draw(canvas)
    return {kind: encoded(canvas, kind) for kind in KINDS}


def _data(report: Report) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(report.columns)
    writer.writerows(report.rows)
    return text.getvalue().encode()


def _facts(figure: Figure, options: FigureOptions, report: Report, said: str) -> bytes:
    """Return the figure's JSON: how it was made, what was fitted, what the paper says.

    Nothing in it depends on where it was made or by how many workers.
    """
    made = {
        name: getattr(options, name)
        for name in ("seed", "runs", "steps", "truth", "equivalences")
    }
    packages = ("numpy", "numba")
    facts = {
        "name": figure.name,
        "title": figure.title,
        "options": made,
        "versions": {"python": platform.python_version(), "neurosnap": version()}
        | {name: metadata.version(name) for name in packages},
        "agreement": said,
        "claims": report.claims,
        **report.facts,
    }
    return msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n"
