"""The picture of an order: its layout, and invalid input."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from neurosnap import EmpiricalSnapshot, PocGraph, Sensorium, plot_order
from neurosnap.errors import InvalidValueError, ShapeError

NAMES = Sensorium(["entry", "door", "motion"])
GRAPH = PocGraph.from_implications(3, [(0, 2), (2, 4)])


def test_what_is_implied_stands_above() -> None:
    state = np.array([False, True] * 3)
    svg = ET.fromstring(plot_order(GRAPH, NAMES, state)._repr_svg_())
    boxes = [group for group in svg if group.tag.endswith("}g")]
    high = {group[1].text: float(group[1].attrib["y"]) for group in boxes}
    assert high["entry"] > high["door"] > high["motion"]
    assert high["motion*"] > high["door*"] > high["entry*"]
    drawn = {group[1].text: group.attrib["class"].strip() for group in boxes}
    starred = {f"{name}*": "off lit" for name in NAMES}
    assert drawn == dict.fromkeys(NAMES, "") | starred


def test_no_line_runs_behind_a_box_and_no_box_on_another() -> None:
    # One line passes a rank on which another element stands.
    order = PocGraph.from_implications(5, [(0, 2), (2, 4), (4, 8), (0, 6), (6, 8)])
    picture = plot_order(order, Sensorium.of(5))
    found = re.findall(r'<rect x="(.*?)" y="(.*?)" rx="4" width="(.*?)"', picture)
    boxes = np.array(found, float)
    assert len(boxes) == 10
    for place, (x, y, wide) in enumerate(boxes):
        beside = np.delete(boxes, place, axis=0)
        beside = beside[beside[:, 1] == y]
        assert ((beside[:, 0] >= x + wide) | (x >= beside[:, 0] + beside[:, 2])).all()
    passing = [line.split()[1:-1] for line in re.findall(r'points="(.*?)"', picture)]
    points = [tuple(map(float, p.split(","))) for line in passing for p in line]
    assert points
    for left, down in points:
        x, y, wide = boxes.T
        assert not ((x < left) & (left < x + wide) & (y < down) & (down < y + 24)).any()


def test_literals_that_are_equal_are_one_box() -> None:
    table = [[k % 2, k % 2, k % 3 == 0] for k in range(60)]
    memory = EmpiricalSnapshot.fit(table, threshold=0.01, names=list(NAMES))
    assert ">entry = door</text>" in plot_order(memory.poc_graph(), NAMES)


def test_what_cannot_be_drawn_is_refused() -> None:
    many = Sensorium.of(121)
    with pytest.raises(InvalidValueError, match="sensors: must be at most 120"):
        plot_order(PocGraph.from_implications(121, []), many)
    with pytest.raises(ShapeError, match="state: must be"):
        plot_order(GRAPH, NAMES, np.zeros(4, np.bool_))
    with pytest.raises(ShapeError, match="sensorium: must have 3 sensors"):
        plot_order(GRAPH, Sensorium.of(4))
