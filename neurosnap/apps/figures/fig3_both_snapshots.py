"""Figure 3: an empirical and a discounted snapshot side by side."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from neurosnap.apps.figures import learners, plots
from neurosnap.apps.figures.curves import Curve
from neurosnap.apps.figures.experiments.learning_error import LearningEntry
from neurosnap.apps.figures.experiments.walks import SETTINGS
from neurosnap.apps.figures.figure import Claim, Figure, FigureOptions, Report
from neurosnap.system.palette import FEW, rgb

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_DECAY = learners.DECAYS[4]
_EMPIRICAL, _DISCOUNTED = rgb(FEW[0]), rgb(FEW[1])


def cells(options: FigureOptions) -> list[LearningEntry]:
    """Return both learners of each setting; figures 1 and 2 have them too."""
    return [
        learners.learner(options, setting.name, learners.LEAST, decay)
        for setting in SETTINGS
        for decay in (None, _DECAY)
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    curves = learners.curves_of(cells(options), rows)
    return learners.report(curves, _draw, claims(learners.by_setting(curves)))


def claims(curves: Mapping[str, Sequence[Curve]]) -> tuple[Claim, ...]:
    """Hold the curves against the paper's text ([GK] discounted:formalism).

    In each setting the empirical curve comes first. That the *interplay is more subtle*
    is all the text says of the figure itself, and no number can decide it.
    """
    pairs = {name: [c.level for c in pair] for name, pair in curves.items()}
    empirical, discounted = zip(*pairs.values(), strict=True)
    spreads = max(empirical) - min(empirical), max(discounted) - min(discounted)
    return (
        Claim(
            "a discounted agent is much more susceptible to geometry and topology than"
            " an empirical one (the eventual deviations of its four settings lie at"
            " least twice as far apart)",
            spreads[1] > 0 and spreads[1] >= 2 * spreads[0],
            f"{spreads[1]:.3g} against {spreads[0]:.3g} edges apart; empirical and"
            " discounted: "
            + ", ".join(
                f"({learners.LETTERS[name]}) {first:.3g} and {second:.3g}"
                for name, (first, second) in pairs.items()
            ),
        ),
    )


def _draw(canvas: "Canvas", curves: Sequence[Curve]) -> None:
    strokes = [
        plots.Stroke(curve, "empirical", _EMPIRICAL, band=True)
        if curve.cell.decay is None
        else plots.Stroke(curve, "discounted", _DISCOUNTED, band=True)
        for curve in curves
    ]
    title = (
        f"Empirical against discounted: τ = 1/{learners.SENSORS}³,"
        rf" $q = 1 - 2^{{-6}}$, {curves[0].cell.runs} random walks"
    )
    plots.draw(canvas, strokes, title, "mean ± std", "log")


FIGURE = Figure(
    name="learning-compared",
    title="Empirical against discounted learning",
    cells=cells,
    report=report,
)
"""Figure 3 ([GK] fig:learning quality)."""
