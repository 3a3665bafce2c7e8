"""Figure 9: faults of a simulated robot, and which methods find them.

The paper has no such experiment. What a method needs to be told, a threshold and over
how many minutes its score is taken, is chosen on robots that are not judged: of what
keeps the budget on them where nothing is wrong, what finds the most.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tools.paper.fig8_homes import Interval, median, ratio, told
from tools.paper.figure import Figure, FigureOptions, Report, markdown
from tools.paper.robot_faults import CASES, METHODS, RobotEntry, trailing

Floats = NDArray[np.float64]

_CHOOSING, _MOST_RUNS = 4, 20
_LEARNED, _JUDGED, _HOURS = 3, 2, 3  # days, days, hours
_OVER = 1, 10, 60  # minutes
_TWIN = 10
_APART = 60  # minutes without that end an alarm
_FAMILIES = {
    name: [m for m in METHODS if m.split(",")[0] == name]
    for name in (
        "health",
        "anomalies",
        "topic rates",
        "isolation forest",
        "autoencoder",
    )
}
_COLUMNS = ("fault", "method", "measure", "value", "low", "high")


class Rule(NamedTuple):
    """When a method raises an alarm."""

    method: str
    minutes: int
    """Its score is the mean over so many."""
    above: float


def cells(options: FigureOptions) -> list[RobotEntry]:
    """Return an entry a robot; the first ones are chosen by, and not judged."""
    count = _CHOOSING + min(options.runs, _MOST_RUNS)
    return [
        RobotEntry(
            runs=1,
            seed=options.seed + number,
            learned=_LEARNED,
            judged=_JUDGED,
            hours=_HOURS,
        )
        for number in range(count)
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    scores = np.array([row[0] for row in rows], float)
    chosen, judged = scores[:_CHOOSING], scores[_CHOOSING:]
    table: dict[tuple[str, str], dict[str, Interval]] = {}
    lines: list[str] = []
    for family, methods in _FAMILIES.items():
        rule = _chosen(methods, chosen)
        lines.append(f"{family}: {rule.method}, {rule.minutes} min, > {rule.above:.4g}")
        for (fault, measure), interval in _measured(rule, judged).items():
            table.setdefault((fault, measure), {})[family] = interval
    shown = markdown(
        ("fault", "measure", *_FAMILIES),
        [[*of, *(told(by[name]) for name in _FAMILIES)] for of, by in table.items()],
    )
    return Report(
        columns=_COLUMNS,
        rows=[
            (fault, method, measure, *(f"{value:.6g}" for value in interval))
            for (fault, measure), by in table.items()
            for method, interval in by.items()
        ],
        lines=(*lines, *shown),
    )


def _chosen(methods: Sequence[str], scores: Floats) -> Rule:
    """Return the rule that finds most while it keeps to an alarm a week."""
    if methods == ["health"]:  # keeps to its budget by itself
        return Rule("health", 1, 0.5)
    allowed = max(1, int(len(scores) * _JUDGED / 7))
    rules = []
    for method in methods:
        for minutes in _OVER:
            clean = [_smooth(each, method, 0, minutes) for each in scores]
            levels = np.unique(np.concatenate(clean))[::-1]
            low, high = 0, len(levels) - 1  # the lowest level that is still quiet
            while low < high:
                middle = (low + high + 1) // 2
                raised = sum(len(_alarms(each, levels[middle])) for each in clean)
                low, high = (middle, high) if raised <= allowed else (low, middle - 1)
            rules.append(Rule(method, minutes, float(levels[low])))
    return max(rules, key=lambda rule: np.isfinite(_delays(rule, scores)).sum())


def _measured(rule: Rule, scores: Floats) -> dict[tuple[str, str], Interval]:
    found: dict[tuple[str, str], Interval] = {}
    clean = np.array([_smooth(each, rule.method, 0, rule.minutes) for each in scores])
    if rule.method == METHODS[0]:
        raised = clean.sum(1)  # a sensor each
    else:
        raised = np.array([float(len(_alarms(row, rule.above))) for row in clean])
    minutes = clean.shape[1]  # of topics fewer are listened to
    weeks = np.full(len(raised), minutes / (7 * 1440))
    found["none", "alarms a week"] = ratio(raised, weeks)
    delays = _delays(rule, scores)
    over = (
        (clean > rule.above).reshape(len(clean), -1, min(minutes, _HOURS * 60)).any(2)
    )
    false = over.mean(1)  # of as many stretches without a fault
    for name, kinds in (
        *((str(kind), [case]) for case, kind in enumerate(CASES) if case),
        ("all", list(range(1, len(CASES)))),
    ):
        own = delays[:, [kind - 1 for kind in kinds]]
        hits = np.isfinite(own).sum(1).astype(float)
        found[name, "recall"] = ratio(hits, np.full(len(hits), float(len(kinds))))
        found[name, "precision"] = ratio(hits, hits + false * len(kinds))
        found[name, "median minutes"] = median(own.ravel())
    return found


def _delays(rule: Rule, scores: Floats) -> Floats:
    """Return after how many minutes each fault is found: ``(robots, faults)``.

    What is told within ten minutes of it without the fault, too, does not count.
    """
    made = np.full((len(scores), len(CASES) - 1), np.inf)
    for robot, each in enumerate(scores):
        twin = np.flatnonzero(_smooth(each, rule.method, 0, rule.minutes) > rule.above)
        for case in range(1, len(CASES)):
            over = _smooth(each, rule.method, case, rule.minutes) > rule.above
            told_of = np.flatnonzero(over)
            own = told_of[(abs(told_of[:, None] - twin) > _TWIN).all(1)]
            if len(own):
                made[robot, case - 1] = own[0] + 1
    return made


def _smooth(scores: Floats, method: str, case: int, minutes: int) -> Floats:
    """Return the scores of a future; before it everything was as it mostly is."""
    own = scores[:, METHODS.index(method)]
    before = np.full(minutes - 1, np.nanmedian(own[0]))
    row = own[case][~np.isnan(own[case])]
    return trailing(np.concatenate([before, row]), minutes)[minutes - 1 :]


def _alarms(row: Floats, above: float) -> list[int]:
    """Return the minutes in which alarms begin."""
    over = np.flatnonzero(row > above)
    return list(over[np.diff(over, prepend=-_APART - 1) > _APART].tolist())


FIGURE = Figure(
    name="robot",
    title="Faults of a simulated robot, and who finds them",
    cells=cells,
    report=report,
)
"""Figure 9; not one of the paper's."""
