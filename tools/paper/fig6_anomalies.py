"""Figure 6: which sensor faults are detected, and which sensors are blamed.

The paper has no such experiment. Walks and faults are made up; what sensors of a real
house do when they fail is not known here, since no recording at hand says which did.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from tools.paper.fault_detection import (
    ALARM,
    AMONG,
    FAULTY,
    HOLD,
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
_EXACT = frozenset(
    {"place", "threshold", "decay", "fault", "judge", "healthy", "shown", "episodes"}
)
"""What the CSV has as it is; the rest are shares and means."""
_COLUMNS = (
    *("learner", "fault", "judged", "wrong steps", "contradict truth", "recall"),
    *("precision", "false in 1000", "faults caught", "delay", "right", "among"),
)
"""Of the table for people."""


class Score(msgspec.Struct, frozen=True):
    """How one judge did, in the second half of walks; the first is for learning.

    A share of nothing is None.
    """

    place: str
    """The world; ``all``: all of them."""
    threshold: float
    decay: float | None
    fault: str
    """Its kind; ``all``: all of them, the walks without one included."""
    judge: Judge
    healthy: int
    """Steps on which no reading is wrong."""
    shown: int
    """Steps on which one is."""
    visible: float | None
    """The share of those that contradict the truth: what can be seen at all."""
    recall: float | None
    """The share of those with an anomaly."""
    false: float | None
    """The share of healthy steps with one."""
    precision: float | None
    """The share of anomalies that are on steps with a wrong reading."""
    episodes: int
    """Faults during which some reading is wrong."""
    caught: float | None
    """The share of them with an anomaly from then on until their end."""
    delay: float | None
    """Mean steps from the first wrong reading to the first anomaly, where caught."""
    right: float | None
    """The share of anomalies, with a wrong reading, that blame just the right ones."""
    among: float | None
    """The share of those where the right ones are among the candidates."""
    early: float
    """The share of steps in the first half, where nothing is wrong, with an anomaly."""


Watched = tuple[DetectionEntry, NDArray[Any]]


def cells(options: FigureOptions) -> list[DetectionEntry]:
    """Return a cell a world, learner and fault, worlds outermost."""
    return [
        DetectionEntry(
            place=place.name,
            threshold=threshold,
            decay=decay,
            fault=fault,
            hold=HOLD,
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
    watched = list(zip(cells(options), rows, strict=True))
    each = [score([one], judge) for one in watched for judge in JUDGES]
    kinds = _summed(watched, lambda cell: cell.fault)
    whole = _summed(watched, lambda cell: "all")
    scores = [*each, *kinds, *whole]
    return Report(
        columns=Score.__struct_fields__,
        rows=[_row(found) for found in scores],
        lines=markdown(_COLUMNS, map(_shown, [*kinds, *whole])),
    )


def score(watched: Sequence[Watched], judge: Judge) -> Score:
    """Return how a judge did in cells of the same learner.

    Args:
        watched: Cells and their flags, ``(runs, steps)`` each.
        judge: Which.
    """
    shift = 3 * JUDGES.index(judge)
    cell = watched[0][0]
    places = {one.place for one, _ in watched}
    kinds = {one.fault for one, _ in watched}
    every = np.concatenate([flags for _, flags in watched])
    first, late = np.hsplit(every, [every.shape[1] // 2])
    shown = late & SHOWN > 0
    alarm = late >> shift & ALARM > 0
    hits = late[shown & alarm] >> shift
    delays = [delay for flags in late for delay in _delays(flags, shift)]
    caught = [delay for delay in delays if delay is not None]
    return Score(
        place=places.pop() if len(places) == 1 else "all",
        threshold=cell.threshold,
        decay=cell.decay,
        fault=kinds.pop() if len(kinds) == 1 else "all",
        judge=judge,
        healthy=int((~shown).sum()),
        shown=int(shown.sum()),
        visible=_share(late[shown] & VISIBLE > 0),
        recall=_share(alarm[shown]),
        false=_share(alarm[~shown]),
        precision=_share(shown[alarm]),
        episodes=len(delays),
        caught=_share(delay is not None for delay in delays),
        delay=float(np.mean(caught)) if caught else None,
        right=_share(hits & RIGHT > 0),
        among=_share(hits & AMONG > 0),
        early=_share(first >> shift & ALARM > 0) or 0.0,
    )


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


def _summed(
    watched: Sequence[Watched], kind: Callable[[DetectionEntry], str]
) -> list[Score]:
    """Return the scores over all worlds of each learner, kind of fault and judge."""
    groups: dict[tuple[float, float | None, str], list[Watched]] = {}
    for cell, flags in watched:
        key = cell.threshold, cell.decay, kind(cell)
        groups.setdefault(key, []).append((cell, flags))
    return [score(group, judge) for group in groups.values() for judge in JUDGES]


def _share(of: NDArray[np.bool_] | Iterable[bool]) -> float | None:
    """Return the share that is true; None of nothing."""
    flags = np.fromiter(of, np.bool_) if not isinstance(of, np.ndarray) else of
    return float(flags.mean()) if flags.size else None


def _row(found: Score) -> list[object]:
    """Return a row of the CSV; what is none is empty, shares have six figures."""
    return [
        "" if value is None else f"{value:.6g}" if name not in _EXACT else value
        for name, value in msgspec.structs.asdict(found).items()
    ]


def _shown(found: Score) -> tuple[str, ...]:
    """Return a row of the table for people."""
    return (
        _learner(found.threshold, found.decay),
        found.fault,
        found.judge,
        str(found.shown),
        *map(_percent, (found.visible, found.recall, found.precision)),
        "–" if found.false is None else f"{1000 * found.false:.3g}",
        f"{_percent(found.caught)} of {found.episodes}",
        "–" if found.delay is None else f"{found.delay:.2g}",
        *map(_percent, (found.right, found.among)),
    )


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.3g} %"


def _learner(threshold: float, decay: float | None) -> str:
    tau = f"τ = 1/{1 / threshold:.0f}"
    if decay is None:
        return f"empirical, {tau}"
    return f"discounted, {tau}, 1 - q = 1/{1 / (1 - decay):.0f}"


FIGURE = Figure(
    name="anomalies",
    title="Faults of sensors, and what is noticed of them",
    cells=cells,
    report=report,
)
"""Figure 6; not one of the paper's."""
