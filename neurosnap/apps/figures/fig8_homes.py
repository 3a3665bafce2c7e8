"""Figure 8: broken sensors in recorded homes, and who finds them.

The paper has no such experiment. Faults are put into recordings of lived-in homes; the
health monitor stands beside simple baselines that were learned from the same past.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.bootstrap import Interval, harmonic, median, ratio, score
from neurosnap.apps.figures.experiments.homes.cases import (
    KINDS,
    SEGMENT_FIELDS,
    WEEK_FIELDS,
)
from neurosnap.apps.figures.experiments.homes.faults import LONG, SINGLE
from neurosnap.apps.figures.experiments.homes.home_entry import HomeEntry, entries
from neurosnap.apps.figures.experiments.homes.methods import METHODS
from neurosnap.apps.figures.figure import Figure, FigureOptions, Report
from neurosnap.errors import InvalidValueError
from neurosnap.health.budget import parse_budget
from neurosnap.system.palette import MANY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Floats = NDArray[np.float64]

_MOST_RUNS = 5
_COLUMNS = ("home", "table", "faults", "method", "measure", "value", "low", "high")
_GROUPS = {"one": SINGLE, **{kind: (kind,) for kind in KINDS[len(SINGLE) :]}}

Row = tuple[str, str, str, str, str, float, float, float]


def cells(options: FigureOptions) -> list[HomeEntry]:
    """Return the cells of all homes.

    Raises:
        InvalidValueError: There is no folder of homes, or the budget is none.
    """
    if options.homes is None:
        raise InvalidValueError("homes", "must be a folder of homes", "none")
    parse_budget(options.alarms)
    runs = min(options.runs, _MOST_RUNS)
    return entries(options.homes, options.alarms, runs, options.seed)


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    made: list[Row] = []
    found: dict[tuple[str, str], Floats] = {}
    for cell, row in zip(cells(options), rows, strict=True):
        found[cell.home, cell.table] = row
        measure = _MEASURES[cell.table]
        made += [(cell.home, cell.table, *each) for each in measure(row)]
    return Report(
        columns=_COLUMNS,
        rows=[(*row[:5], *(f"{value:.6g}" for value in row[5:])) for row in made],
        draw=lambda canvas: _draw(canvas, found),
        claims=(),
        facts={"alarms": options.alarms},
        lines=tuple(_markdown(made)),
    )


Measured = Iterator[tuple[str, str, str, float, float, float]]
"""Faults, method, measure, value, low, high."""


def _segments(row: Floats) -> Measured:
    """Yield T1, detection per segment, and T2, identification."""
    at = {name: place for place, name in enumerate(SEGMENT_FIELDS)}
    groups = _GROUPS | {kind: (kind,) for kind in SINGLE}
    for group, kinds in groups.items():
        chosen = row[:, [KINDS.index(kind) for kind in kinds]]
        every = chosen.reshape(-1, *chosen.shape[-2:])
        every = every[~np.isnan(every[:, 0, 0])]
        for place, method in enumerate(METHODS):
            case = every[:, place]

            def field(name: str, of: Floats = case) -> Floats:
                return of[:, at[name]]

            hit, wrong = field("found"), field("false")
            one = np.ones(len(case))
            seen = field("visible")
            named, right, there = field("named"), field("right"), field("faulty")
            for name, interval in (
                ("precision", ratio(hit, hit + wrong)),
                ("recall", ratio(hit, one)),
                ("recall of visible", ratio(hit * seen, seen)),
                ("F1", score(np.column_stack([hit, hit + wrong, one]), harmonic)),
                ("minutes", median(_there(field("minutes")))),
                ("visible", ratio(seen, one)),
                ("id precision", ratio(right, named)),
                ("id recall", ratio(right, there)),
                ("id F1", score(np.column_stack([right, named, there]), harmonic)),
                ("exact", ratio(field("exact"), seen)),
                ("named", ratio(named, hit)),
                ("id minutes", median(_there(field("minutes right")))),
            ):
                yield group, method, name, *interval
        yield group, "always alarm", "precision", 0.5, 0.5, 0.5
        yield group, "always alarm", "recall", 1.0, 1.0, 1.0
        yield group, "always alarm", "F1", 2 / 3, 2 / 3, 2 / 3


def _there(values: Floats) -> Floats:
    return values[~np.isnan(values)]


def _long(row: Floats) -> Measured:
    for number, kind in enumerate(LONG):
        for place, method in enumerate(METHODS):
            hours = _there(row[:, number, ..., place].ravel())
            got = np.isfinite(hours).astype(float)
            yield kind, method, "found", *ratio(got, np.ones(len(got)))
            yield kind, method, "median hours", *median(hours)


def _week(row: Floats) -> Measured:
    at = {name: place for place, name in enumerate(WEEK_FIELDS)}
    for number, kind in enumerate(("50 false", "all removed")):
        for place, method in enumerate(METHODS):
            case = row[:, number, :, place].reshape(-1, len(WEEK_FIELDS))
            case = case[~np.isnan(case[:, 0])]
            found, true = case[:, at["found"]], case[:, at["true"]]
            yield kind, method, "recall", *ratio(found, np.ones(len(case)))
            yield kind, method, "precision", *ratio(true, case[:, at["all"]])
            yield kind, method, "median hours", *median(_there(case[:, at["hours"]]))


def _hourly(row: Floats) -> Measured:
    for place, method in enumerate(METHODS):
        for at, name in enumerate(("AUC", "AUC per sensor", "TPR at FPR 0.02")):
            values = _there(row[:, place, at])
            yield "one", method, name, *ratio(values, np.ones(len(values)))


def _clean(row: Floats) -> Measured:
    days = row[0][:, ~np.isnan(row[0, 0])]
    for place, method in enumerate(METHODS):
        one = np.ones(days.shape[1])
        yield "none", method, "alarms a day", *ratio(days[place], one)
        yield "none", method, "alarms an event", *ratio(days[place], days[-1])


def _outages(row: Floats) -> Measured:
    listed = row[0][~np.isnan(row[0, :, 0])]
    for place, method in enumerate(METHODS):
        hours = listed[:-1, place]
        got = np.isfinite(hours).astype(float)
        yield "natural", method, "found", *ratio(got, np.ones(len(got)))
        yield "natural", method, "median hours", *median(hours)
        outside = float(listed[-1, place])
        yield "natural", method, "alarms a day outside", outside, outside, outside


_MEASURES = {
    "segments": _segments,
    "long": _long,
    "week": _week,
    "hourly": _hourly,
    "clean": _clean,
    "outages": _outages,
}


def _markdown(rows: Iterable[Row]) -> Iterator[str]:
    """Yield a table for people: a line each home, table, faults and measure."""
    tables: dict[tuple[str, str, str, str], dict[str, Interval]] = {}
    for home, table, faults, method, measure, value, low, high in rows:
        key = home, table, faults, measure
        tables.setdefault(key, {})[method] = value, low, high
    names = (*METHODS, "always alarm")
    yield "| home | table | faults | measure | " + " | ".join(names) + " |"
    yield "|" + " --- |" * (4 + len(names))
    for of, by in tables.items():
        told = [_told(by[name]) if name in by else "" for name in names]
        yield "| " + " | ".join([*of, *told]) + " |"


def _told(interval: Interval) -> str:
    value, low, high = interval
    if np.isnan(value):
        return "–"
    return f"{value:.3g} ({low:.3g} to {high:.3g})"


def _draw(canvas: "Canvas", found: dict[tuple[str, str], Floats]) -> None:
    """Draw, a row a home: how soon long fail-stops are found, and who is named."""
    homes = sorted({home for home, _ in found})
    canvas.set_size_inches(12, 3.4 * len(homes))
    panels = canvas.subplots(len(homes), 2, squeeze=False)
    for (left, right), home in zip(panels, homes, strict=True):
        _curves(left, found[home, "long"])
        _bars(right, found[home, "segments"])
        left.set_ylabel(f"{home}\nlong fail-stops found")
        right.set_ylabel("F1 of named sensors")
    panels[-1, 0].set_xlabel("hours since the failure")
    panels[0, 0].legend(fontsize="small", frameon=False)


def _curves(axes: "Axes", row: Floats) -> None:
    for place, method in enumerate(METHODS):
        hours = np.sort(_there(row[:, 0, ..., place].ravel()))
        share = np.arange(1, len(hours) + 1) / max(1, len(hours))
        got = np.isfinite(hours)
        colour = MANY[place]
        axes.step(hours[got], share[got], where="post", color=colour, label=method)
    axes.set_ylim(0, 1)
    axes.set_xlim(0, 168)
    axes.grid(alpha=0.25, lw=0.6)


def _bars(axes: "Axes", row: Floats) -> None:
    values = {
        (group, method): value
        for group, method, measure, value, _, _ in _segments(row)
        if measure == "id F1" and group in _GROUPS
    }
    for place, method in enumerate(METHODS):
        heights = [np.nan_to_num(values[group, method]) for group in _GROUPS]
        places = np.arange(len(heights)) + 0.16 * (place - 2)
        axes.bar(places, heights, 0.15, color=MANY[place])
    axes.set_xticks(range(len(_GROUPS)), list(_GROUPS), fontsize="small")
    axes.set_ylim(0, 1)
    axes.grid(axis="y", alpha=0.25, lw=0.6)


FIGURE = Figure(
    name="homes",
    title="Broken sensors in recorded homes, and who finds them",
    cells=cells,
    report=report,
)
"""Figure 8; not one of the paper's."""
