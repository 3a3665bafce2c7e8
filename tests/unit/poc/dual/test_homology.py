"""Complexes and finite spaces: well-known shapes, and invalid input."""

from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.dual.homology import CellComplex


def test_the_surface_of_a_cube_and_the_cube() -> None:
    corners = np.array(list(np.ndindex(2, 2, 2)), np.bool_)
    solid = CellComplex.cubical(corners)
    assert solid.face_vector() == (8, 12, 6, 1)
    assert solid.betti_numbers() == (1, 0, 0, 0)
    block = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)])
    shell = np.concatenate([block > 0, block > 1], axis=1)
    assert CellComplex.cubical(shell).betti_numbers() == (1, 0, 1)


def test_boundaries_that_are_none_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^face: must be in \[0, 2\)"):
        CellComplex([[()] * 2, [(0, 2)]])
    with pytest.raises(InvalidValueError, match=r"^cell: must have a boundary without"):
        CellComplex([[()] * 3, [(0, 1), (1, 2)], [(0, 1)]])
    with pytest.raises(ShapeError, match=r"^corners: must be \(vertices, n\)"):
        CellComplex.cubical(np.zeros(3, np.bool_))
    numbers: Any = np.zeros((3, 2))
    with pytest.raises(InvalidValueError, match=r"^corners: must be bool"):
        CellComplex.cubical(numbers)
