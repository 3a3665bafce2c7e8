"""Figure 6: which sensor faults are detected, and which sensors are blamed.

The paper has no such experiment. Walks and faults are made up; what sensors of a real
house do when they fail is not known here, since no recording at hand says which did.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments.fault_detection import (
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
from neurosnap.apps.figures.experiments.sensor_faults import FAULTS, PLACES
from neurosnap.apps.figures.figure import Figure, FigureOptions, Report
from neurosnap.apps.figures.learners import DECAYS, LEAST
from neurosnap.system.palette import FEW

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

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
_COLOURS: dict[Judge, str] = dict(zip(JUDGES, FEW, strict=True))


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
        draw=lambda canvas: _draw(canvas, kinds, whole),
        claims=(),
        facts={"scores": scores},
        lines=tuple(_markdown([*kinds, *whole])),
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


def _markdown(scores: Sequence[Score]) -> Iterable[str]:
    """Yield the lines of a table for people."""
    yield f"| {' | '.join(_COLUMNS)} |"
    yield "|" + " --- |" * len(_COLUMNS)
    for found in scores:
        shares = (found.visible, found.recall, found.precision)
        line = [
            _learner(found.threshold, found.decay),
            found.fault,
            found.judge,
            str(found.shown),
            *map(_percent, shares),
            "–" if found.false is None else f"{1000 * found.false:.3g}",
            f"{_percent(found.caught)} of {found.episodes}",
            "–" if found.delay is None else f"{found.delay:.2g}",
            *map(_percent, (found.right, found.among)),
        ]
        yield f"| {' | '.join(line)} |"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.3g} %"


def _learner(threshold: float, decay: float | None) -> str:
    tau = f"τ = 1/{1 / threshold:.0f}"
    if decay is None:
        return f"empirical, {tau}"
    return f"discounted, {tau}, 1 - q = 1/{1 / (1 - decay):.0f}"


def _draw(canvas: "Canvas", kinds: Sequence[Score], whole: Sequence[Score]) -> None:
    """Draw recall above and false alarms below, a column a learner."""
    drawn, silent = _told_of(kinds)
    canvas.set_size_inches(1.8 + 2.8 * max(len(drawn), 2), 6.5)
    panels = canvas.subplots(2, len(drawn), sharey="row", squeeze=False)
    for (above, below), learner in zip(panels.T, drawn, strict=True):
        above.set_title(_learner(*learner), fontsize="medium")
        mine = [s for s in kinds if (s.threshold, s.decay) == learner]
        _recall(above, [s for s in mine if s.fault != "none"])
        _false(below, [s for s in whole if (s.threshold, s.decay) == learner])
    panels[0, 0].set_ylabel("steps with a wrong reading\nthat are anomalies (%)")
    panels[1, 0].set_ylabel("healthy steps\nthat are anomalies (in 1000)")
    panels[1, 0].set_yscale("symlog", linthresh=1)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    canvas.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), frameon=False
    )
    title = "Faults of sensors: what is noticed, in five worlds together"
    for learner in silent:
        title += f"\n{_learner(*learner)}: no anomaly at all, not drawn"
    canvas.suptitle(title)


def _told_of(scores: Sequence[Score]) -> tuple[list[Learner], list[Learner]]:
    """Return the learners to draw, and those that told of no step at all.

    A discounted one has learned nothing before some hundred steps: its panels would be
    empty. If all are like that, the empty panels are what there is.
    """
    told = {(s.threshold, s.decay) for s in scores if s.recall or s.false}
    drawn = [learner for learner in _LEARNERS if learner in told]
    silent = [learner for learner in _LEARNERS if learner not in told]
    return (drawn, silent) if drawn else (silent, [])


def _recall(axes: "Axes", scores: Sequence[Score]) -> None:
    faults = [fault for fault in FAULTS if fault != "none"]
    for number, judge in enumerate(JUDGES):
        mine = {s.fault: s for s in scores if s.judge == judge}
        heights = [100 * (mine[fault].recall or 0.0) for fault in faults]
        places = np.arange(len(faults)) + 0.27 * (number - 1)
        axes.bar(places, heights, 0.25, color=_COLOURS[judge], label=f"judged {judge}")
        if judge == JUDGES[-1]:
            seen = [100 * (mine[fault].visible or 0.0) for fault in faults]
            axes.plot(range(len(faults)), seen, "k_", ms=26, label="contradicts truth")
    axes.set_xticks(range(len(faults)), faults, fontsize="small")
    axes.set_ylim(0, 100)
    axes.grid(axis="y", alpha=0.25, lw=0.6)


def _false(axes: "Axes", scores: Sequence[Score]) -> None:
    heights = [1000 * (found.false or 0.0) for found in scores]
    colours = [_COLOURS[found.judge] for found in scores]
    bars = axes.bar(range(len(scores)), heights, 0.6, color=colours)
    axes.bar_label(bars, [f"{height:.3g}" for height in heights], fontsize="small")
    axes.set_xticks(range(len(scores)), [s.judge for s in scores], fontsize="small")
    axes.set_ylim(0, 3000)  # room for the numbers over 1000


FIGURE = Figure(
    name="anomalies",
    title="Faults of sensors, and what is noticed of them",
    cells=cells,
    report=report,
)
"""Figure 6; not one of the paper's."""
