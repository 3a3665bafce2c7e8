"""The picture of an order for notebooks."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.text import Text

from neurosnap import EmpiricalSnapshot, PocGraph, Sensorium, plot_order
from neurosnap.errors import InvalidValueError, ShapeError

NAMES = Sensorium(["entry", "door", "motion"])
GRAPH = PocGraph.from_implications(3, [(0, 2), (2, 4)])


def heights(texts: list[Text]) -> dict[str, float]:
    return {text.get_text(): text.get_position()[1] for text in texts}


def test_what_is_implied_stands_above() -> None:
    figure = plot_order(GRAPH, NAMES)
    (axes,) = figure.axes
    high = heights(list(axes.texts))
    assert high["entry"] < high["door"] < high["motion"]
    assert high["motion*"] < high["door*"] < high["entry*"]


def test_literals_that_are_equal_are_one_box() -> None:
    table = [[k % 2, k % 2, k % 3 == 0] for k in range(60)]
    memory = EmpiricalSnapshot.fit(table, threshold=0.01, names=list(NAMES))
    (axes,) = plot_order(memory.poc_graph(), NAMES).axes
    assert "entry = door" in heights(list(axes.texts))


def test_what_cannot_be_drawn_is_refused() -> None:
    many = Sensorium.of(121)
    with pytest.raises(InvalidValueError, match="sensors: must be at most 120"):
        plot_order(PocGraph.from_implications(121, []), many)
    with pytest.raises(ShapeError, match="state: must be"):
        plot_order(GRAPH, NAMES, np.zeros(4, np.bool_))
    with pytest.raises(ShapeError, match="sensorium: must have 3 sensors"):
        plot_order(GRAPH, Sensorium.of(4))
