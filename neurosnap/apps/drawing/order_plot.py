"""A picture of an order for notebooks: its Hasse diagram."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from neurosnap.apps.drawing.hasse_panel import hasse_panel
from neurosnap.apps.drawing.page import sheet
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 120
"""Sensors that are drawn: of more nobody sees anything."""


def plot_order(
    graph: PocGraph, sensors: Sensorium, state: ArrayLike | None = None
) -> "Figure":
    """Return the Hasse diagram of an order as a figure of matplotlib.

    What stands below implies what a line leads up to; literals that imply each other
    are one box. Jupyter shows the figure once matplotlib.pyplot is imported; `savefig`
    writes it.

    Args:
        graph: What was learned: `Snapshot.poc_graph`.
        sensors: The names of its sensors.
        state: ``(2N,)`` bool: literals that are believed now, to be lit; None: none.

    Returns:
        As large as what is on it, in inches.

    Raises:
        InvalidValueError: There are more than `MOST` sensors; or a literal is
            equivalent to its own complement, as unknown readings may have it.
        ShapeError: `graph` or `state` is of other sensors.
        MissingExtraError: matplotlib is not installed.
    """
    if len(sensors) > MOST:
        raise InvalidValueError("sensors", f"must be at most {MOST}", len(sensors))
    lit = None if state is None else np.asarray(state, np.bool_)
    if lit is not None and lit.shape != (2 * len(sensors),):
        raise ShapeError("state", f"must be ({2 * len(sensors)},)", lit.shape)
    return sheet(hasse_panel(PocSet.from_graph(graph, sensors), None, lit))
