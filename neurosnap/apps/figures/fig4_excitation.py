"""Figure 4: distance of excitation-driven agents from their targets."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.policy import EXPLORE
from neurosnap.apps.figures import learners
from neurosnap.apps.figures.experiments.target_distance import (
    TargetEntry,
    guaranteed,
    task,
)
from neurosnap.apps.figures.experiments.walks import SETTINGS
from neurosnap.apps.figures.figure import Claim, Figure, FigureOptions, Report
from neurosnap.system.palette import FEW

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_DECAY = learners.DECAYS[4]
_END = 0  # the place at one end of the path
_BINS = 90
_SINCE = (1000, 4000)  # steps from which on means are told
_COLOURS = {None: FEW[0], _DECAY: FEW[1]}
_TITLES = {
    "path": "path, thresholds",
    "cycle": "cycle, beacons",
    "grid": "grid, thresholds",
    "random": "path, random fields (dotted: target at its end)",
}


def cells(options: FigureOptions) -> list[TargetEntry]:
    """Return an empirical and a discounted agent a setting, settings outermost.

    Targets are drawn. With random fields, most targets have nothing around them that
    would tell on which side of them one is; so there agents whose target is the end of
    the path come after.
    """
    return [
        TargetEntry(
            setting=name,
            threshold=learners.LEAST,
            decay=decay,
            explore=EXPLORE,
            target=target,
            runs=options.runs,
            steps=options.steps,
            seed=options.seed,
        )
        for name, target in (*((s.name, None) for s in SETTINGS), ("random", _END))
        for decay in (None, _DECAY)
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    courses = list(zip(cells(options), rows, strict=True))
    truths = {
        setting.name: [
            guaranteed(task(setting.name, options.seed, run))
            for run in range(options.runs)
        ]
        for setting in SETTINGS
    }
    return Report(
        columns=("setting", "decay", "target", "step", "mean", "std", "min", "max"),
        rows=_table(courses),
        draw=lambda canvas: _draw(canvas, courses),
        claims=claims(courses, truths),
        facts={
            "courses": [_summary(cell, distances) for cell, distances in courses],
            "guaranteed": {name: min(shares) for name, shares in truths.items()},
        },
        lines=tuple(_line(cell, distances) for cell, distances in courses),
    )


def claims(
    courses: Sequence[tuple[TargetEntry, NDArray[Any]]],
    truths: dict[str, list[float]],
) -> tuple[Claim, ...]:
    """Hold the distances against the paper's text ([GK] "Closing the Loop")."""
    sure = [name for name in ("path", "cycle", "grid") if min(truths[name]) == 1]
    arrived = {
        (cell.setting, cell.decay is None): float((distances[:, -1] <= 1).mean())
        for cell, distances in courses
        if cell.target is None
    }
    least = min(share for (name, _), share in arrived.items() if name != "random")
    return (
        Claim(
            "in (a)-(c) every place but the target has a sensation and an action that"
            " lead nearer from wherever it is sensed (share of places, least of runs)",
            len(sure) == 3,
            ", ".join(
                f"({s.letter}) {min(truths[s.name]):.3g}, mean"
                f" {np.mean(truths[s.name]):.3g}"
                for s in SETTINGS
            ),
            steps=0,
        ),
        Claim(
            "the strategy gives agents in (a)-(c) the exposure they need to capture the"
            " target (every run ends within distance 1 of it)",
            least == 1,
            ", ".join(
                f"{name} {'empirical' if plain else 'discounted'} {share:.0%}"
                for (name, plain), share in arrived.items()
            ),
        ),
    )


def _summary(cell: TargetEntry, distances: NDArray[Any]) -> dict[str, Any]:
    means = distances.mean(axis=0)
    return {
        "setting": cell.setting,
        "threshold": cell.threshold,
        "decay": cell.decay,
        "target": cell.target,
        "explore": cell.explore,
        "mean_since": {
            str(since): float(means[since - 1 :].mean())
            for since in _SINCE
            if since <= cell.steps
        },
        "within_one": float((distances[:, -1] <= 1).mean()),
    }


def _line(cell: TargetEntry, distances: NDArray[Any]) -> str:
    facts = _summary(cell, distances)
    since = ", ".join(
        f"{mean:.3g} from step {step} on" for step, mean in facts["mean_since"].items()
    )
    kind = "empirical" if cell.decay is None else "discounted"
    return (
        f"{cell.setting}, {kind}{_towards(cell)}: {facts['within_one']:.0%} of runs end within 1 of the"
        f" target; mean distance {since or f'{distances.mean():.3g}'}"
    )


def _towards(cell: TargetEntry) -> str:
    return "" if cell.target is None else f", target {cell.target}"


def _table(
    courses: Sequence[tuple[TargetEntry, NDArray[Any]]],
) -> Iterator[Sequence[object]]:
    for cell, distances in courses:
        head = (
            cell.setting,
            "" if cell.decay is None else repr(cell.decay),
            "drawn" if cell.target is None else cell.target,
        )
        columns = zip(
            distances.mean(axis=0).tolist(),
            distances.std(axis=0).tolist(),
            distances.min(axis=0).tolist(),
            distances.max(axis=0).tolist(),
            strict=True,
        )
        for step, (mean, std, least, most) in enumerate(columns, 1):
            yield *head, step, f"{mean:.6g}", f"{std:.6g}", least, most


def _draw(
    canvas: "Canvas", courses: Sequence[tuple[TargetEntry, NDArray[Any]]]
) -> None:
    canvas.set_size_inches(10, 7)
    panels = canvas.subplots(2, 2, sharex=True, sharey=True)
    for axes, setting in zip(panels.flat, SETTINGS, strict=True):
        axes.set_title(f"({setting.letter}) {_TITLES[setting.name]}", fontsize="medium")
        for cell, distances in courses:
            if cell.setting == setting.name:
                _stroke(axes, cell, distances)
        axes.grid(alpha=0.25, lw=0.6)
    steps, runs = courses[0][0].steps, courses[0][0].runs
    first = panels.flat[0]
    first.set_xscale("log")
    first.set_xlim(1, max(2, 1.15 * steps))
    first.set_yscale("symlog", linthresh=0.02, linscale=0.3)
    first.set_ylim(bottom=0)
    ticks = [0, 0.1, 0.3, 1, 3, 10]
    first.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    first.yaxis.set_minor_locator(_nothing())
    for axes in panels[1]:
        axes.set_xlabel("step (observations)")
    for axes in panels[:, 0]:
        axes.set_ylabel("distance to the target (actions)")
    handles, labels = first.get_legend_handles_labels()
    canvas.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), frameon=False
    )
    canvas.suptitle(
        f"Excitation-driven agents: mean and quartiles of {runs} runs that begin"
        " with an empty snapshot"
    )


def _nothing() -> Any:  # noqa: ANN401 - matplotlib is imported late
    from matplotlib.ticker import NullLocator

    return NullLocator()


def _stroke(axes: "Axes", cell: TargetEntry, distances: NDArray[Any]) -> None:
    # On a logarithmic scale late steps lie too dense to be seen one by one.
    edges = (
        np.unique(np.geomspace(1, cell.steps, _BINS, endpoint=False).astype(np.intp))
        - 1
    )
    widths = np.diff(np.append(edges, cell.steps))
    binned = np.add.reduceat(distances.astype(np.float64), edges, axis=1) / widths
    steps = edges + (widths + 1) / 2
    low, high = np.percentile(binned, (25, 75), axis=0)
    colour = _COLOURS[cell.decay]
    label = "empirical" if cell.decay is None else r"discounted, $q = 1 - 2^{-6}$"
    if cell.target is None:
        axes.fill_between(steps, low, high, color=colour, alpha=0.15, lw=0)
    style = "-" if cell.target is None else ":"
    axes.plot(steps, binned.mean(axis=0), style, color=colour, lw=1.1, label=label)


FIGURE = Figure(
    name="agents-excited",
    title="Excitation-driven agents",
    cells=cells,
    report=report,
)
"""Figure 4 ([GK] fig:sniffy)."""
