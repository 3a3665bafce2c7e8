"""Figures as drawn: nothing over an edge, no empty panels, colours for everybody."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from neurosnap.apps.figures import (
    fig1_empirical,
    fig2_discounted,
    fig5_obstructions,
    fig6_anomalies,
    learners,
)
from neurosnap.apps.figures.experiments.fault_detection import ALARM, JUDGES, SHOWN
from neurosnap.apps.figures.experiments.obstacles import ARRIVED, FIRST, arena
from neurosnap.apps.figures.figure import FigureOptions, Report
from neurosnap.system.palette import FEW, QUANTITY, steps

pytestmark = pytest.mark.slow

SMALL = FigureOptions(runs=2, steps=40)


def drawn(report: Report) -> Figure:
    figure = Figure(layout="constrained")
    report.draw(figure)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return figure


def obstructions() -> Figure:
    """Return the figure of agents half of whose starts arrive, and all on the rail."""
    rows = []
    for cell in fig5_obstructions.cells(SMALL):
        places = len(arena(cell.world, cell.target).coordinates)
        found = np.zeros((2, places, 3), np.int32)
        found[:, :, FIRST] = 0
        if "Rail" not in cell.world:
            found[0, ::2, ARRIVED] = -1
        rows.append(found)
    return drawn(fig5_obstructions.report(SMALL, rows))


def test_nothing_of_obstructions_crosses_a_frame_or_is_wider_than_it() -> None:
    figure = obstructions()
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert len(panels) == 6
    for axes in panels:
        frame = axes.get_window_extent()
        for text in axes.texts:
            box = text.get_window_extent()
            assert frame.x0 < box.x0 < box.x1 < frame.x1, text.get_text()
            assert frame.y0 < box.y0 < box.y1 < frame.y1, text.get_text()
        for label in (axes.xaxis.label, axes.title):
            assert label.get_window_extent().width < 1.06 * frame.width
    shares = [text.get_text() for text in panels[5].texts]
    assert shares == ["75 %", "75 %", "75 %", "100 %", "100 %", "100 %"]


def test_obstructions_are_in_colours_that_everybody_tells_apart() -> None:
    figure = obstructions()
    maps = [axes.images[0] for axes in figure.axes if axes.images]
    assert [image.get_cmap().name for image in maps] == [QUANTITY] * 3
    rail = next(axes for axes in figure.axes if axes.get_title().startswith("circular"))
    own = [line for line in rail.lines if line.get_linestyle() == "-"]
    assert {to_hex(line.get_color()) for line in own} == set(FEW)
    assert len({line.get_marker() for line in own}) == 3


@pytest.mark.parametrize("module", [fig1_empirical, fig2_discounted])
def test_steps_of_a_quantity_have_a_colour_bar_and_labels_no_line(module: Any) -> None:
    cells = module.FIGURE.cells(SMALL)
    falling = np.linspace(40, 0, SMALL.steps, dtype=np.int64)
    figure = drawn(module.report(SMALL, [np.stack([falling] * 2)] * len(cells)))
    *panels, bar = figure.axes
    assert len(panels) == 4
    assert not figure.legends
    count = len(learners.THRESHOLDS if module is fig1_empirical else learners.DECAYS)
    assert len(bar.get_yticklabels()) == count
    for axes in panels:
        assert not axes.texts  # they would stand where a line may run
        assert axes.get_title().endswith(f"all {count} coincide")
        assert [line.get_color() for line in axes.lines] == steps(count)


def anomalies(*, empirical: bool, discounted: bool) -> Figure:
    """Return the figure of learners that tell of each wrong reading, or of nothing."""
    rows = []
    for cell in fig6_anomalies.cells(SMALL):
        flags = np.zeros((2, SMALL.steps), np.int64)
        if cell.fault != "none":
            flags[:, 30:] = SHOWN
            if empirical if cell.decay is None else discounted:
                flags[:, 30:] |= sum(ALARM << 3 * n for n in range(len(JUDGES)))
        rows.append(flags)
    return drawn(fig6_anomalies.report(SMALL, rows))


@pytest.mark.parametrize(
    ("empirical", "discounted", "columns", "left_out"),
    [
        (True, True, 4, 0),
        (True, False, 2, 2),
        (False, True, 2, 2),
        (False,) * 2 + (4, 0),
    ],
)
def test_learners_that_tell_of_nothing_are_named_and_not_drawn(
    *, empirical: bool, discounted: bool, columns: int, left_out: int
) -> None:
    figure = anomalies(empirical=empirical, discounted=discounted)
    assert len(figure.axes) == 2 * columns
    assert figure.get_suptitle().count("no anomaly at all, not drawn") == left_out
    bars: list[Any] = [bar for axes in figure.axes for bar in axes.patches]
    assert any(bar.get_height() for bar in bars) == (empirical or discounted)
