"""The paper's model spaces: their sizes and definitions."""

from collections.abc import Callable

import pytest

from neurosnap.poc.dual.cubing import Cubing
from tests.support.paper_spaces import (
    Example,
    beacons,
    grid_with_holes,
    path_with_motion,
    six_arcs,
    six_wide_arcs,
    thresholds,
)

EXAMPLES = (
    *(thresholds, beacons, six_arcs, six_wide_arcs, grid_with_holes),
    path_with_motion,
)
ACTIONS = ["fwd", "back", "wait"]


@pytest.mark.parametrize("make", EXAMPLES)
def test_every_example_is_consistent(make: Callable[[], Example]) -> None:
    example = make()
    assert example.realization.poc_set() == example.poc
    assert not example.marked or Cubing(example.poc).is_vertex(example.mark())
    assert len(example.cells) in (0, example.realization.fields.shape[1])


@pytest.mark.parametrize("length", [2, 5])
def test_motion_is_a_product_less_two_squares(length: int) -> None:
    """[GK] fig:interval with motion, basic."""
    poc = path_with_motion(length).poc
    rest = [name for name in poc.sensorium if name not in ACTIONS]
    whole = Cubing(poc.restricted(ACTIONS) | poc.restricted(rest))
    assert Cubing(poc.restricted(ACTIONS)).face_vector() == (4, 3)
    assert whole.face_vector() == (4 * (length + 1), 7 * length + 3, 3 * length)
    less = (4 * length + 2, 7 * length - 1, 3 * length - 2)
    assert Cubing(poc).face_vector() == less
