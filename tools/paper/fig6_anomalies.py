"""Figure 6: which sensor faults are detected, and which sensors are blamed.

The paper has no such experiment. Walks and faults are made up; what sensors of a real
house do when they fail is not known here, since no recording at hand says which did.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
from numpy.typing import NDArray

from tools.paper.fault_detection import (
    ALARM,
    AMONG,
    FAULTY,
    JUDGES,
    RIGHT,
    SHOWN,
    VISIBLE,
    DetectionEntry,
    Judge,
)
from tools.paper.figure import Figure, FigureOptions, Report, markdown
from tools.paper.learners import DECAYS, LEAST
from tools.paper.sensor_faults import FAULTS, PLACES

Learner: TypeAlias = tuple[float, float | None]
"""A threshold, and a decay if it forgets."""

_MOST_RUNS = 5  # watchers go step by step: a run takes a second
_FORGIVING = 0.01
_LEARNERS: tuple[Learner, ...] = (
    (LEAST, None),
    (_FORGIVING, None),
    (LEAST, DECAYS[4]),
    (_FORGIVING, DECAYS[8]),
)
"""A snapshot of each kind that one exception convinces, and one that takes more."""
_KEYS = ["place", "threshold", "decay", "fault", "judge"]
"""What a row of the CSV is of; a place or fault is ``all`` for the sum of them."""
_SHARES = {
    "visible": ("contradicting", "shown"),
    "recall": ("hits", "shown"),
    "false": ("cries", "healthy"),
    "precision": ("hits", "alarms"),
    "caught": ("noticed", "episodes"),
    "delay": ("waited", "noticed"),
    "right": ("named", "hits"),
    "among": ("listed", "hits"),
    "early": ("before", "first"),
}
"""The other columns, and the counts, see `counted`, of which they are the quotients."""
_COLUMNS = (
    *("learner", "fault", "judged", "wrong steps", "contradict truth", "recall"),
    *("precision", "false in 1000", "faults caught", "delay", "right", "among"),
)
"""Of the table for people."""


Watched = tuple[DetectionEntry, NDArray[Any]]


def cells(options: FigureOptions) -> list[DetectionEntry]:
    """Return a cell a world, learner and fault, worlds outermost."""
    return [
        DetectionEntry(
            place=place,
            threshold=threshold,
            decay=decay,
            fault=fault,
            runs=min(options.runs, _MOST_RUNS),
            steps=options.steps,
            seed=options.seed,
        )
        for place in PLACES
        for threshold, decay in _LEARNERS
        for fault in FAULTS
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    scores = scored(list(zip(cells(options), rows, strict=True)))
    columns = [*_KEYS, "healthy", "shown", "episodes", *_SHARES]
    sums = scores[scores["place"] == "all"]
    return Report(
        columns=tuple(columns),
        rows=scores[columns].astype(object).where(scores.notna(), "").to_numpy(),
        lines=markdown(_COLUMNS, map(_shown, sums.to_dict("records"))),
    )


def scored(watched: Sequence[Watched]) -> Any:  # noqa: ANN401 - a frame of pandas
    """Return a row of counts and shares for each cell and judge, and for their sums.

    They are of the second half of walks; the first is for learning. After the cells
    come the sums over worlds, by kind of fault, and those over all of them, the walks
    without a fault included. A share of nothing is not a number.
    """
    each = pd.DataFrame(
        counted(cell, flags, judge) for cell, flags in watched for judge in JUDGES
    )
    keep: dict[str, Any] = {"dropna": False, "sort": False, "as_index": False}
    kinds = each.assign(place="all").groupby(_KEYS, **keep).sum()
    whole = kinds.assign(fault="all").groupby(_KEYS, **keep).sum()
    scores = pd.concat([each, kinds, whole], ignore_index=True)
    for share, (part, of) in _SHARES.items():
        scores[share] = scores[part] / scores[of]
    return scores


def counted(cell: DetectionEntry, flags: NDArray[Any], judge: Judge) -> dict[str, Any]:
    """Return what a judge did in a cell, in counts.

    `healthy` and `shown` are steps without and with a wrong reading, `episodes` faults
    during which some reading is wrong; see `_SHARES` for what the others are parts of.
    """
    first, late = np.hsplit(flags, [flags.shape[1] // 2])
    shift = 3 * JUDGES.index(judge)
    shown, alarm = late & SHOWN > 0, late >> shift & ALARM > 0
    hits = late[shown & alarm] >> shift
    delays = [delay for run in late for delay in _delays(run, shift)]
    caught = [delay for delay in delays if delay is not None]
    return {
        "place": cell.place,
        "threshold": cell.threshold,
        "decay": cell.decay,
        "fault": cell.fault,
        "judge": judge,
        "healthy": int((~shown).sum()),
        "shown": int(shown.sum()),
        "contradicting": int((late[shown] & VISIBLE > 0).sum()),
        "hits": len(hits),
        "alarms": int(alarm.sum()),
        "cries": int(alarm[~shown].sum()),
        "episodes": len(delays),
        "noticed": len(caught),
        "waited": sum(caught),
        "named": int((hits & RIGHT > 0).sum()),
        "listed": int((hits & AMONG > 0).sum()),
        "first": first.size,
        "before": int((first >> shift & ALARM > 0).sum()),
    }


def _delays(flags: NDArray[Any], shift: int) -> list[int | None]:
    """Return how long each fault that shows went on before it was noticed, if it was.

    Two faults on end are one.
    """
    faulty = np.concatenate([[False], flags & FAULTY > 0, [False]])
    bounds = np.flatnonzero(faulty[1:] != faulty[:-1]).reshape(-1, 2)
    delays: list[int | None] = []
    for begin, end in bounds.tolist():
        during = flags[begin:end]
        shown = np.flatnonzero(during & SHOWN)
        if not shown.size:
            continue
        found = np.flatnonzero(during[shown[0] :] >> shift & ALARM)
        delays.append(int(found[0]) if found.size else None)
    return delays


def _shown(found: dict[str, Any]) -> tuple[str, ...]:
    """Return a row of the table for people."""
    return (
        _learner(found["threshold"], found["decay"]),
        found["fault"],
        found["judge"],
        str(found["shown"]),
        *(_number(100 * found[name], " %") for name in ("visible", "recall")),
        _number(100 * found["precision"], " %"),
        _number(1000 * found["false"]),
        f"{_number(100 * found['caught'], ' %')} of {found['episodes']}",
        _number(found["delay"]),
        *(_number(100 * found[name], " %") for name in ("right", "among")),
    )


def _number(value: float, unit: str = "") -> str:
    return "–" if np.isnan(value) else f"{value:.3g}{unit}"


def _learner(threshold: float, decay: float) -> str:
    tau = f"τ = 1/{1 / threshold:.0f}"
    if np.isnan(decay):
        return f"empirical, {tau}"
    return f"discounted, {tau}, 1 - q = 1/{1 / (1 - decay):.0f}"


FIGURE = Figure(
    name="anomalies",
    title="Faults of sensors, and what is noticed of them",
    cells=cells,
    report=report,
)
"""Figure 6; not one of the paper's."""
