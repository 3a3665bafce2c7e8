"""Complexes and finite spaces: the shapes everybody knows, and what is refused."""

from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.dual.homology import CellComplex, cubes_among
from neurosnap.poc.dual.realization import Realization
from tests.support.finite_space import FiniteSpace
from tests.support.homotopy import richness, space_of
from tests.support.simplices import simplicial
from tools.paper.spaces import six_arcs

# The projective plane with six vertices: over GF(2) it has homology in dimension 2.
PLANE = [
    (0, 1, 4),
    (0, 1, 5),
    (0, 2, 3),
    (0, 2, 5),
    (0, 3, 4),
    (1, 2, 3),
    (1, 2, 4),
    (1, 3, 5),
    (2, 4, 5),
    (3, 4, 5),
]


@pytest.mark.parametrize(
    ("simplices", "betti"),
    [
        ([(0,)], (1,)),
        ([(0,), (1,)], (2,)),
        ([(0, 1), (1, 2), (0, 2)], (1, 1)),
        ([(0, 1, 2)], (1, 0, 0)),
        ([(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)], (1, 0, 1)),
        (PLANE, (1, 1, 1)),
        ([], ()),
    ],
)
def test_shapes_of_simplices(simplices: list[tuple[int, ...]], betti: Any) -> None:
    assert simplicial(simplices).betti_numbers() == betti


def test_the_surface_of_a_cube_and_the_cube() -> None:
    corners = np.array(list(np.ndindex(2, 2, 2)), np.bool_)
    solid = CellComplex.cubical(corners)
    assert solid.face_vector() == (8, 12, 6, 1)
    assert solid.betti_numbers() == (1, 0, 0, 0)
    assert repr(solid) == "CellComplex(vertices=8, edges=12, squares=6, cubes=1)"
    assert len(list(cubes_among(corners))) == 27
    block = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)])
    shell = np.concatenate([block > 0, block > 1], axis=1)
    assert CellComplex.cubical(shell).betti_numbers() == (1, 0, 1)


def test_a_torus_from_its_boundaries() -> None:
    def edge(kind: int, x: int, y: int) -> int:
        return 9 * kind + 3 * (x % 3) + y % 3

    places = [(x, y) for x in range(3) for y in range(3)]

    def vertex(x: int, y: int) -> int:
        return 3 * (x % 3) + y % 3

    edges = [(vertex(x, y), vertex(x + 1, y)) for x, y in places]
    edges += [(vertex(x, y), vertex(x, y + 1)) for x, y in places]
    squares = [
        (edge(0, x, y), edge(0, x, y + 1), edge(1, x, y), edge(1, x + 1, y))
        for x, y in places
    ]
    torus = CellComplex([[()] * 9, edges, squares])
    assert torus.betti_numbers() == (1, 2, 1)


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


def test_finite_spaces() -> None:
    circle = FiniteSpace(4, [(0, 2), (0, 3), (1, 2), (1, 3)])
    assert not circle.is_contractible()
    assert circle.order_complex().betti_numbers() == (1, 1)
    arc = np.array([True, True, True, False])
    assert circle.is_contractible(arc)
    assert not circle.is_contractible(np.zeros(4, np.bool_))
    triangle = FiniteSpace.of_cells([[0], [1], [2], [0, 1], [1, 2], [0, 2], [0, 1, 2]])
    assert triangle.is_contractible()
    assert len(list(triangle.chains())) == 6
    assert len(triangle) == 7


@pytest.mark.parametrize(
    ("points", "below", "message"),
    [
        (-1, [], r"^points: must be 0 or more, got -1"),
        (2, [(0, 2)], r"^pair: must be of points in \[0, 2\), got \(0, 2\)"),
        (3, [(0, 1), (1, 2), (2, 0)], r"^points: must not be below each other, got"),
    ],
)
def test_bad_spaces_are_refused(points: int, below: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        FiniteSpace(points, below)


def test_richness_says_what_is_torn_and_what_is_tangled() -> None:
    line = FiniteSpace(3, [(0, 2), (1, 2)])
    jump = Realization([[1, 0, 0], [0, 0, 1]], ["a", "b"], ["left", "right", "between"])
    report = richness(jump, line)
    assert report.torn == (("left", "between"),)
    assert report.tangled == (("b*",),)
    assert not report.holds
    apart = richness(Realization([[1, 1, 0]], ["ends"]), line)
    assert apart.tangled == (("ends",),)
    with pytest.raises(ShapeError, match=r"^space: must have 24 points, got 3"):
        richness(six_arcs().realization, line)


def test_points_outside_the_dual_witness_nothing() -> None:
    arcs = six_arcs()
    believed = arcs.poc
    report = richness(arcs.realization, space_of(arcs), believed)
    assert report.holds
    alone = Realization([[1, 0], [1, 0]], ["a", "b"])
    wrong = type(believed).parse("a, b : a < b*")
    assert richness(alone, FiniteSpace(2, [(0, 1)]), wrong).torn == (("0", "1"),)
