"""Figure 7: what growing sensors and planning by imagined waves are good for.

The paper has no such experiment: it names both as future work. In each world several
learners explore for equally many steps; then they are sent on the same journeys.
"""

from collections.abc import Iterable, Sequence
from typing import Any, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from tools.paper.explorers import CHECKS
from tools.paper.figure import Figure, FigureOptions, Report, markdown
from tools.paper.growing import (
    FALLS,
    FALSE,
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
from tools.paper.stages import settings, stage_of

METHODS: tuple[Method, ...] = get_args(Method)
KINDS = ("any to any", "to the goal", "fares", "squares")
_MOST_RUNS = 3  # agents go step by step: a run takes up to minutes
_TARGETS = 500
_ANEW: tuple[Method, ...] = ("growth and imagining", "table", "Q-learning", "Dyna-Q")
_COLUMNS = (
    *("world", "learner", "runs", "moves whole", "whole after", "grown", "in use"),
    *("journeys", "of them", "reached", "shortest", "waves a step"),
    *("falls", "unforeseen"),
)


class Score(msgspec.Struct, frozen=True):
    """How one learner did in a world, all runs together."""

    world: str
    learner: str
    runs: int
    steps: int
    """Of exploration, in a run."""
    moves: int
    """Of the world, but for where the episode is over."""
    whole: tuple[int, ...]
    """Of how many, in each run, all is guaranteed in the end; of a table: tried."""
    false: tuple[int, ...]
    """Of how many something false is."""
    after: tuple[int, ...]
    """Steps after which all were for the first time seen to be; -1: they never were."""
    grown: tuple[int, ...]
    """Sensors grown in each run; of a table: entries."""
    used: tuple[int, ...]
    """Those in use in the end."""
    kind: str
    """Of the journeys."""
    journeys: int
    reached: int
    shortest: int
    waves: float | None
    """Planning waves a step; None: the learner has none."""
    falls: int | None
    """Steps of the journeys into a hole or over the cliff; None: not counted."""
    unforeseen: int | None
    """Those that the agent did not foresee, likewise."""


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
    scores = [found for pair in pairs for found in scored(*pair)]
    return Report(
        columns=("world", "learner", "run", "steps", "whole", "false", "grown", "used"),
        rows=_curves(pairs),
        lines=markdown(_COLUMNS, map(_shown, scores)),
    )


def scored(cell: GrowthEntry, rows: NDArray[Any]) -> list[Score]:
    """Return the scores of a cell, one for each kind of journey.

    Args:
        cell: The cell.
        rows: ``(runs, checks + journeys, 6)``.
    """
    stage = stage_of(cell.setting)
    moves = int((~stage.over).sum()) * len(stage.actions)
    curves, journeys = (
        rows[:, :CHECKS, :4],
        rows[:, CHECKS:].reshape(-1, rows.shape[-1]),
    )
    journeys = journeys[journeys[:, NEED] >= 0]
    found = []
    for kind in np.unique(journeys[:, KIND]).tolist():
        mine = journeys[journeys[:, KIND] == kind]
        there = mine[:, STEPS] >= 0
        steps = int(mine[there, STEPS].sum())
        waves = mine[there, WAVES].sum() / max(1, steps)
        found.append(
            Score(
                world=cell.setting.name,
                learner=cell.method,
                runs=cell.runs,
                steps=cell.setting.steps,
                moves=moves,
                whole=tuple(curves[:, -1, WHOLE].tolist()),
                false=tuple(curves[:, -1, FALSE].tolist()),
                after=tuple(_after(cell, curve, moves) for curve in curves),
                grown=tuple(curves[:, -1, GROWN].tolist()),
                used=tuple(curves[:, -1, USED].tolist()),
                kind=f"{_TARGETS} targets" if cell.targets else KINDS[kind],
                journeys=len(mine),
                reached=int(there.sum()),
                shortest=int((mine[:, STEPS] == mine[:, NEED]).sum()),
                waves=float(waves) if waves else None,
                falls=int(mine[:, FALLS].sum()) if waves else None,
                unforeseen=int(mine[:, UNFORESEEN].sum()) if waves else None,
            )
        )
    return found


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


def _shown(found: Score) -> tuple[str, ...]:
    """Return a row of the table for people."""
    curve = (
        f"{_range(found.whole)} of {found.moves}",
        *map(_range, (found.after, found.grown, found.used)),
    )
    learns = found.learner not in ("Q-learning", "Dyna-Q")
    return (
        found.world,
        found.learner,
        str(found.runs),
        *(curve if learns else ("–",) * 4),
        found.kind,
        *map(str, (found.journeys, found.reached, found.shortest)),
        "–" if found.waves is None else f"{found.waves:.3g}",
        *("–" if n is None else str(n) for n in (found.falls, found.unforeseen)),
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
