"""Figure 8: broken sensors in recorded homes, and which methods find them.

The paper has no such experiment. Faults are put into recordings of lived-in homes; the
health monitor stands beside simple baselines that were learned from the same past.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm_budget import parse_budget
from tools.paper.figure import Figure, FigureOptions, Report, markdown
from tools.paper.homes.cases import (
    KINDS,
    SEGMENT_FIELDS,
    WEEK_FIELDS,
    HomeEntry,
    entries,
)
from tools.paper.homes.faults import LONG, SINGLE
from tools.paper.homes.methods import METHODS

Floats = NDArray[np.float64]
Interval = tuple[float, float, float]
"""A value, and the bounds of its 95 % interval by drawing cases again."""

_MOST_RUNS = 5
_DRAWS = 1000
_SEED = 16
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
    for cell, row in zip(cells(options), rows, strict=True):
        measure = _MEASURES[cell.table]
        made += [(cell.home, cell.table, *each) for each in measure(row)]
    return Report(
        columns=_COLUMNS,
        rows=[(*row[:5], *(f"{value:.6g}" for value in row[5:])) for row in made],
        lines=_shown(made),
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
            named, right, there = field("named"), field("right"), field("faulty")
            for name, interval in (
                ("precision", ratio(hit, hit + wrong)),
                ("recall", ratio(hit, one)),
                ("F1", score(np.column_stack([hit, hit + wrong, one]), harmonic)),
                ("id F1", score(np.column_stack([right, named, there]), harmonic)),
            ):
                yield group, method, name, *interval
        yield group, "always alarm", "precision", 0.5, 0.5, 0.5
        yield group, "always alarm", "recall", 1.0, 1.0, 1.0
        yield group, "always alarm", "F1", 2 / 3, 2 / 3, 2 / 3


def _long(row: Floats) -> Measured:
    for number, kind in enumerate(LONG):
        for place, method in enumerate(METHODS):
            hours = row[:, number, ..., place].ravel()
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
            hours = case[:, at["hours"]]
            yield kind, method, "median hours", *median(hours[np.isfinite(hours)])


def _clean(row: Floats) -> Measured:
    days = row[0]
    for place, method in enumerate(METHODS):
        one = np.ones(days.shape[1])
        yield "none", method, "alarms a day", *ratio(days[place], one)


_MEASURES = {
    "segments": _segments,
    "long": _long,
    "week": _week,
    "clean": _clean,
}


def _shown(rows: Iterable[Row]) -> tuple[str, ...]:
    """Return a table for people: a line each home, table, faults and measure."""
    tables: dict[tuple[str, str, str, str], dict[str, Interval]] = {}
    for home, table, faults, method, measure, value, low, high in rows:
        key = home, table, faults, measure
        tables.setdefault(key, {})[method] = value, low, high
    names = (*METHODS, "always alarm")
    return markdown(
        ("home", "table", "faults", "measure", *names),
        (
            [*of, *(told(by[name]) if name in by else "" for name in names)]
            for of, by in tables.items()
        ),
    )


def told(interval: Interval) -> str:
    """Return an interval for people."""
    value, low, high = interval
    if np.isnan(value):
        return "–"
    return f"{value:.3g} ({low:.3g} to {high:.3g})"


def ratio(above: Floats, below: Floats) -> Interval:
    """Return the sum of one over the sum of the other, cases drawn together.

    Args:
        above: ``(cases,)``.
        below: ``(cases,)``.

    Returns:
        Not a number if there is nothing below.
    """
    return score(np.column_stack([above, below]), lambda s: _over(s[..., 0], s[..., 1]))


def score(columns: Floats, of: Callable[[Floats], Floats]) -> Interval:
    """Return a function of the sums of columns.

    Args:
        columns: ``(cases, columns)``.
        of: Takes sums, ``(..., columns)``, and returns values, ``(...)``.
    """
    count = len(columns)
    if not count:
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(_SEED)
    times = rng.multinomial(count, np.full(count, 1 / count), _DRAWS)
    values = of(times @ columns)
    values = values[~np.isnan(values)]
    whole = float(of(columns.sum(0)))
    if not len(values):
        return whole, np.nan, np.nan
    low, high = np.quantile(values, (0.025, 0.975))
    return whole, float(low), float(high)


def harmonic(sums: Floats) -> Floats:
    """Return F1 of sums of right ones, of those named, and of those there are."""
    right, named, there = sums[..., 0], sums[..., 1], sums[..., 2]
    return _over(2 * right, named + there)


def median(values: Floats) -> Interval:
    """Return the median; values may be infinite."""
    if not len(values):
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(_SEED)
    ordered = np.sort(values)
    drawn = rng.integers(0, len(values), (_DRAWS, len(values)))
    middle = ordered[np.partition(drawn, len(values) // 2, axis=1)[:, len(values) // 2]]
    low, high = np.quantile(middle, (0.025, 0.975), method="nearest")
    return float(ordered[len(values) // 2]), float(low), float(high)


def _over(above: Floats, below: Floats) -> Floats:
    return np.asarray(np.divide(above, np.where(below > 0, below, np.nan)))


FIGURE = Figure(
    name="homes",
    title="Broken sensors in recorded homes, and who finds them",
    cells=cells,
    report=report,
)
"""Figure 8; not one of the paper's."""
