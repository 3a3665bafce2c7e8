"""Figure 7: the benefit of growing sensors and of planning several steps ahead.

The paper has no such experiment: it names both as future work. In each world several
learners explore for equally many steps; then they are sent on the same journeys.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from tools.paper.explorers import CHECKS
from tools.paper.figure import Figure, FigureOptions, Report, markdown
from tools.paper.growing import (
    FALLS,
    GROWN,
    KIND,
    NEED,
    STEPS,
    UNFORESEEN,
    USED,
    WAVES,
    WHOLE,
    GrowthEntry,
    Method,
)
from tools.paper.worlds_as_tables import settings, stage_of

METHODS: tuple[Method, ...] = get_args(Method)
KINDS = ("any to any", "to the goal")
_MOST_RUNS = 3  # agents go step by step: a run takes up to minutes
_TARGETS = 500
_ANEW: tuple[Method, ...] = ("growth and imagining", "table", "Q-learning", "Dyna-Q")
_COLUMNS = (
    *("world", "learner", "runs", "moves whole", "whole after", "grown", "in use"),
    *("journeys", "of them", "reached", "shortest", "waves a step"),
    *("falls", "unforeseen"),
)


def cells(options: FigureOptions) -> list[GrowthEntry]:
    """Return a cell a world and learner, worlds outermost; then any targets."""
    runs = min(options.runs, _MOST_RUNS)
    every = [
        GrowthEntry(setting=setting, method=method, runs=runs, seed=options.seed)
        for setting in settings()
        for method in METHODS
    ]
    (taxi,) = (setting for setting in settings() if setting.name == "taxi")
    return every + [
        GrowthEntry(
            setting=taxi, method=method, runs=1, seed=options.seed, targets=_TARGETS
        )
        for method in _ANEW
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    pairs = list(zip(cells(options), rows, strict=True))
    return Report(
        columns=("world", "learner", "run", "steps", "whole", "false", "grown", "used"),
        rows=_curves(pairs),
        lines=markdown(_COLUMNS, (line for pair in pairs for line in _lines(*pair))),
    )


def _lines(cell: GrowthEntry, rows: NDArray[Any]) -> Iterator[tuple[str, ...]]:
    """Yield a line of the table for each kind of journey; see `_COLUMNS`.

    A learner of values has no curve. What no journey asked for or met is not shown: a
    method without waves counts no falls either.

    Args:
        cell: The cell.
        rows: ``(runs, checks + journeys, 6)``.
    """
    stage = stage_of(cell.setting)
    moves = int((~stage.over).sum()) * len(stage.actions)
    curves = rows[:, :CHECKS, :4]
    ends = curves[:, -1]
    curve = (
        f"{_range(ends[:, WHOLE].tolist())} of {moves}",
        _range([_after(cell, each, moves) for each in curves]),
        _range(ends[:, GROWN].tolist()),
        _range(ends[:, USED].tolist()),
    )
    learns = cell.method not in ("Q-learning", "Dyna-Q")
    journeys = rows[:, CHECKS:].reshape(-1, rows.shape[-1])
    journeys = journeys[journeys[:, NEED] >= 0]
    for kind in np.unique(journeys[:, KIND]).tolist():
        mine = journeys[journeys[:, KIND] == kind]
        there = mine[:, STEPS] >= 0
        waves = mine[there, WAVES].sum() / max(1, mine[there, STEPS].sum())
        falls = (mine[:, FALLS].sum(), mine[:, UNFORESEEN].sum())
        yield (
            cell.setting.name,
            cell.method,
            str(cell.runs),
            *(curve if learns else ("–",) * len(curve)),
            f"{_TARGETS} targets" if cell.targets else KINDS[kind],
            str(len(mine)),
            str(there.sum()),
            str((mine[:, STEPS] == mine[:, NEED]).sum()),
            *((f"{waves:.3g}", *map(str, falls)) if waves else ("–",) * 3),
        )


def _after(cell: GrowthEntry, curve: NDArray[Any], moves: int) -> int:
    """Return when all moves were first seen to be guaranteed whole; -1: never."""
    done = np.flatnonzero(curve[:, WHOLE] >= moves)
    return int(done[0] + 1) * _every(cell) if done.size else -1


def _every(cell: GrowthEntry) -> int:
    return max(1, cell.setting.steps // CHECKS)


def _curves(
    pairs: Sequence[tuple[GrowthEntry, NDArray[Any]]],
) -> Iterable[Sequence[object]]:
    for cell, rows in pairs:
        for run, curve in enumerate(rows[:, :CHECKS, :4].tolist()):
            for check, point in enumerate(curve, 1):
                yield (
                    cell.setting.name + (", targets" if cell.targets else ""),
                    cell.method,
                    run,
                    check * _every(cell),
                    *point,
                )


def _range(values: Sequence[int]) -> str:
    shown = ["never" if value < 0 else str(value) for value in sorted(values)]
    if shown[0] == "never" and shown[-1] != "never":
        return f"never, {shown[-1]}"
    return shown[0] if shown[0] == shown[-1] else f"{shown[0]} to {shown[-1]}"


FIGURE = Figure(
    name="growth",
    title="Growing sensors, and planning by imagined waves",
    cells=cells,
    report=report,
)
"""Figure 7; not one of the paper's."""
