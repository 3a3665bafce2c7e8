"""Figure 2: learning rate of discounted snapshots, ten decays, four settings."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from tools.paper import learners
from tools.paper.curves import Curve
from tools.paper.figure import Claim, Figure, FigureOptions, Report
from tools.paper.learning_error import LearningEntry
from tools.paper.walks import SETTINGS

_BEST, _BETTER_WAIT = 5, 4
_UNIFORM = 0.25  # every weight of a new snapshot

Curves = Mapping[str, Sequence[Curve]]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    curves = learners.curves_of(_cells(options), rows)
    labels = [rf"$1 - 2^{{-{k + 2}}}$" for k in range(len(learners.DECAYS))]
    title = f"Discounted snapshots by decay q, τ = 1/{learners.SENSORS}³"
    return learners.report(curves, claims(curves), title, labels, "log")


def _cells(options: FigureOptions) -> list[LearningEntry]:
    return learners.learners(options, discounted=True)


def claims(curves: Curves) -> tuple[Claim, ...]:
    """Hold the curves against the paper's text ([GK] discounted:performance).

    The *eventual* deviation of a learner is its `level`. In each setting the curves are
    those of ``k = 0, 1, …``.
    """
    return (_not_monotone(curves), _best(curves), _wait(curves), _lower_bound(curves))


def _not_monotone(curves: Curves) -> Claim:
    levels = {name: [c.level for c in chosen] for name, chosen in curves.items()}
    bent = [
        each not in (sorted(each), sorted(each, reverse=True))
        for each in levels.values()
    ]
    woken = _woken(curves)
    return Claim(
        "learning does not depend on q monotonically (the eventual deviation both falls"
        " and rises with k, in every setting)",
        all(bent),
        "; ".join(
            f"({SETTINGS[name].letter}) {' '.join(f'{level:.3g}' for level in each)}"
            for name, each in levels.items()
        )
        + f"; the first change is at step {_listed(woken)} for the first {len(woken)} k",
    )


def _best(curves: Curves) -> Claim:
    parts, best = [], []
    for name, chosen in curves.items():
        levels = [curve.level for curve in chosen]
        least = min(levels)
        winners = [k for k, level in enumerate(levels) if level == least]
        best.append(_BEST in winners)
        parts.append(
            f"({SETTINGS[name].letter}) k = {', '.join(map(str, winners))} with {least:.3g},"
            f" k = {_BEST} has {levels[_BEST]:.3g}"
        )
    return Claim(
        f"k = {_BEST} works best for all settings as to the eventual deviation",
        all(best),
        "; ".join(parts),
    )


def _wait(curves: Curves) -> Claim:
    waits = {
        name: (curves[name][_BETTER_WAIT].halved, curves[name][_BEST].halved)
        for name in ("path", "cycle", "grid")
    }
    return Claim(
        f"k = {_BETTER_WAIT} waits less than k = {_BEST} for meaningful learning in"
        " (a), (b), (c) (until the mean has halved from its peak)",
        all(
            short is not None and (long is None or short < long)
            for short, long in waits.values()
        ),
        ", ".join(
            f"({SETTINGS[name].letter}) {short} against {long} steps"
            for name, (short, long) in waits.items()
        ),
    )


def _lower_bound(curves: Curves) -> Claim:
    """The bound is for a weight at its largest, and a new snapshot has 1/4."""
    woken = _woken(curves)
    threshold = learners.LEAST
    bounds = {q: to_learn(threshold, q) for q in woken}
    starts = {q: to_learn(threshold, q, _UNIFORM) for q in woken}
    return Claim(
        "nothing goes on record in fewer than log τ / log q observations",
        all(woken[q] >= bounds[q] for q in woken),
        f"the first change is at step {_listed(woken)}, the bound allows"
        f" {_listed(bounds)}, and from the weight a snapshot starts with, 1/4, it is"
        f" {_listed(starts)}",
    )


def _woken(curves: Curves) -> dict[float, int]:
    """Return the first step with a change in any setting, for decays that have one."""
    woken: dict[float, int] = {}
    for chosen in curves.values():
        for curve in chosen:
            if curve.cell.decay is not None and curve.woken is not None:
                q = curve.cell.decay
                woken[q] = min(woken.get(q, curve.woken), curve.woken)
    return woken


def _listed(numbers: Mapping[float, int]) -> str:
    return " ".join(str(numbers[q]) for q in sorted(numbers)) or "none"


def to_learn(threshold: float, decay: float, weight: float = 1.0) -> int:
    """Return after how many observations without ``a b*`` its weight is below `tau`.

    The least ``k`` with ``q^k w < tau``: the paper's ``k > log tau / log q`` for a
    weight of 1.

    Args:
        threshold: ``tau``, in (0, 1/4].
        decay: ``q`` in (0, 1).
        weight: ``w_ab*`` at first, in [0, 1]; a new snapshot has 1/4.
    """
    if weight < threshold:
        return 0
    # The logarithms land next to the answer; the powers themselves decide.
    count = max(0, math.floor(math.log(threshold / weight) / math.log(decay)) - 1)
    while decay**count * weight >= threshold:
        count += 1
    return count


FIGURE = Figure(
    name="learning-discounted",
    title="Discounted learning",
    cells=_cells,
    report=report,
)
"""Figure 2 ([GK] fig:discounted learners)."""
