"""Figure 1: learning rate of empirical snapshots, ten thresholds, four settings."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tools.paper import learners
from tools.paper.curves import Curve, fitted
from tools.paper.figure import Claim, Figure, FigureOptions, Report
from tools.paper.learning_error import LearningEntry
from tools.paper.walks import SETTINGS, walk

_EXPONENTIAL = 0.9
_STILL = 0.05
_AROUND = 2.0

Curves = Mapping[str, Sequence[Curve]]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    curves = learners.curves_of(_cells(options), rows)
    labels = [_label(threshold) for threshold in learners.THRESHOLDS]
    title = "Empirical snapshots by threshold τ"
    return learners.report(curves, claims(options, curves), title, labels, "linear")


def _cells(options: FigureOptions) -> list[LearningEntry]:
    return learners.learners(options, discounted=False)


def claims(options: FigureOptions, curves: Curves) -> tuple[Claim, ...]:
    """Hold the curves against the paper's text ([GK] empirical:performance).

    The text of the figure is about true containments; of the thresholded truth there is
    the proposition on convergence. In each setting thresholds go up.
    """
    if options.truth == "thresholded":
        return (_converges(curves),)
    smallest = _smallest_probabilities(options)
    return (
        _declines_sooner(curves),
        _random_lags(curves),
        _path_learns_all(curves),
        _large_plateau(curves),
        _small_reach_zero(curves),
        _critical(curves, smallest),
        _crossing(options),
        _grid_like_path(curves),
        _cycle_keeps_level(curves),
    )


def _converges(curves: Curves) -> Claim:
    every = [curve for chosen in curves.values() for curve in chosen]
    zero = [curve for curve in every if curve.reaches_zero]
    fits = [fitted(curve) for curve in zero]
    good = sum(fit is not None and fit.r2 >= _EXPONENTIAL for fit in fits)
    return Claim(
        "Err(t) converges to zero at an exponential rate (all learners have no error at"
        f" the last step, and their fits R² ≥ {_EXPONENTIAL})",
        len(zero) == len(every) == good,
        f"{len(zero)} of {len(every)} have no error, {good} of these with such a fit",
    )


def _declines_sooner(curves: Curves) -> Claim:
    waits = {name: [curve.halved for curve in curves[name]] for name in curves}
    sooner = {
        name: sum(
            _before(b, a) for b, a in zip(waits[name], waits["path"], strict=True)
        )
        for name in ("cycle", "grid")
    }
    total = len(waits["path"])
    return Claim(
        "(b) and (c) decline more sharply at first than (a) (their mean has halved from"
        " its peak after fewer steps, at every threshold)",
        all(count == total for count in sooner.values()),
        f"sooner at {sooner['cycle']} of {total} thresholds in (b), {sooner['grid']} in"
        f" (c); at the smallest threshold halved at step {waits['path'][0]} in (a),"
        f" {waits['cycle'][0]} in (b), {waits['grid'][0]} in (c)",
    )


def _before(first: int | None, second: int | None) -> bool:
    """Whether something happened, and sooner."""
    return first is not None and (second is None or first < second)


def _random_lags(curves: Curves) -> Claim:
    means = {name: [float(c.mean.mean()) for c in curves[name]] for name in curves}
    structured = list(zip(means["path"], means["cycle"], means["grid"], strict=True))
    worst = sum(
        mine > max(others)
        for mine, others in zip(means["random"], structured, strict=True)
    )
    first = ", ".join(
        f"{means[name][0]:.3g} in ({SETTINGS[name].letter})" for name in means
    )
    return Claim(
        "(d) lags behind all structured settings (its error, averaged over all steps, is"
        " the largest at every threshold)",
        worst == len(structured),
        f"the largest at {worst} of {len(structured)} thresholds; at the smallest"
        f" threshold {first}",
    )


def _path_learns_all(curves: Curves) -> Claim:
    chosen = curves["path"]
    zero = sum(curve.reaches_zero for curve in chosen)
    fits = [fit for fit in map(fitted, chosen) if fit is not None]
    good = sum(fit.r2 >= _EXPONENTIAL for fit in fits)
    worst = f"{min(fit.r2 for fit in fits):.3f}" if fits else "none"
    return Claim(
        "(a) learns exponentially fast no matter what (no error at the last step, and a"
        f" fit with R² ≥ {_EXPONENTIAL}, at every threshold)",
        zero == good == len(chosen),
        f"{zero} of {len(chosen)} have no error, {good} such a fit, the smallest R² is"
        f" {worst}",
    )


def _large_plateau(curves: Curves) -> Claim:
    found = {name: curves[name][-1] for name in ("cycle", "grid", "random")}
    still = {name: _is_still(curve) for name, curve in found.items()}
    return Claim(
        "for large τ the deviation of (b), (c), (d) plateaus (at τ = 1/4 it is not 0 and"
        f" changes by less than {_STILL:.0%} over the last fifth)",
        all(still.values()),
        ", ".join(
            f"({SETTINGS[name].letter}) {'still' if still[name] else 'not still'} at"
            f" {curve.level:.4g}"
            for name, curve in found.items()
        ),
    )


def _is_still(curve: Curve) -> bool:
    tenth = max(1, len(curve.mean) // 10)
    before = float(curve.mean[-2 * tenth : -tenth].mean()) if tenth > 1 else 0.0
    return curve.level > 0 and abs(curve.level - before) < _STILL * curve.level


def _small_reach_zero(curves: Curves) -> Claim:
    found = {name: curves[name][0] for name in ("cycle", "grid", "random")}
    return Claim(
        "for small enough τ the deviation of (b), (c), (d) decreases to zero in finite"
        " time (at the smallest, in every run)",
        all(curve.reaches_zero for curve in found.values()),
        _lasts(found),
    )


def _critical(curves: Curves, smallest: Mapping[str, float]) -> Claim:
    """The paper expects the critical threshold *somewhere around*: a factor of two."""
    parts, around = [], []
    for name in ("cycle", "grid", "random"):
        good = [c.cell.threshold for c in curves[name] if c.reaches_zero]
        bad = [c.cell.threshold for c in curves[name] if not c.reaches_zero]
        low, high = max(good, default=0.0), min(bad, default=np.inf)
        around.append(low / _AROUND <= smallest[name] <= high * _AROUND and low < high)
        parts.append(
            f"({SETTINGS[name].letter}) between {low:.3g} and {high:.3g} against"
            f" {smallest[name]:.3g}"
        )
    return Claim(
        "the critical τ is around the least probability of a place (between the"
        " largest τ without error and the smallest with one, give or take a factor of"
        f" {_AROUND:g})",
        all(around),
        ", ".join(parts),
    )


def _crossing(options: FigureOptions) -> Claim:
    """The sensors of the grid's two axes are its first and its last half."""
    there = walk("grid", options.seed, 0, 1)
    count = len(there.fields)
    i, j = np.tril_indices(count, -1)
    across = (i >= count // 2) & (j < count // 2)
    entries = 8 * int(across.sum())
    wrong = 2 * int(np.unpackbits(there.contained[across]).sum())
    return Claim(
        "in (c) x and y cross everywhere: 800 of 1600 entries of the true matrix are 0"
        " because of it",
        entries == 800 and (2 * count) ** 2 == 1600 and wrong == 0,
        f"{entries} of {(2 * count) ** 2} entries, {wrong} of them not 0",
        steps=0,
    )


def _grid_like_path(curves: Curves) -> Claim:
    pairs = list(zip(curves["path"], curves["grid"], strict=True))
    alike = sum(a.reaches_zero == c.reaches_zero for a, c in pairs)
    return Claim(
        "the behaviour of (c) may be inferred from that of (a) (both reach zero or"
        " neither does, at every threshold)",
        alike == len(pairs),
        f"alike at {alike} of {len(pairs)} thresholds;"
        f" (a) reaches zero at {sum(a.reaches_zero for a, _ in pairs)},"
        f" (c) at {sum(c.reaches_zero for _, c in pairs)}",
    )


def _cycle_keeps_level(curves: Curves) -> Claim:
    found = {name: chosen[0] for name, chosen in curves.items()}
    plunged = {name for name, curve in found.items() if curve.reaches_zero}
    return Claim(
        "sub-critical τ make (a), (c), (d) plunge to zero, and (b) keeps to a horizontal"
        " asymptote (at the smallest)",
        plunged == {"path", "grid", "random"},
        _lasts(found),
    )


def _lasts(curves: Mapping[str, Curve]) -> str:
    means = ", ".join(
        f"{curve.mean[-1]:.4g} ± {curve.error:.2g} in ({SETTINGS[name].letter})"
        for name, curve in curves.items()
    )
    return f"mean at the last step {means}"


def _smallest_probabilities(options: FigureOptions) -> dict[str, float]:
    """Return the least positive stationary probability of a place in each setting."""
    laws = {name: walk(name, options.seed, 0, 1).law for name in SETTINGS}
    return {name: float(law[law > 0].min()) for name, law in laws.items()}


def _label(threshold: float) -> str:
    if threshold == learners.LEAST:
        return f"1/{learners.SENSORS}³"
    return "1/4" if threshold == learners.THRESHOLDS[-1] else f"{threshold:.3f}"


FIGURE = Figure(
    name="learning-empirical",
    title="Empirical learning",
    cells=_cells,
    report=report,
)
"""Figure 1 ([GK] fig:empirical learners)."""
