"""Cubings: their sizes, convex sets, and invalid input."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from tests.support.paper_spaces import chain, exclusive


def test_the_simple_example() -> None:
    """[GK] fig:duality for a simple relation: a square with a tail."""
    cubing = Cubing(PocSet.parse("a, b, c : a < c*, b < c*"))
    assert cubing.face_vector() == (5, 5, 1)
    assert cubing.dimension == 2
    assert next(cubing.cubes(2))[1] == (0, 2)
    tail = [0, 2, 5]
    assert cubing.is_vertex(tail)
    assert [len(cube) for cube in cubing.cubes_at([1, 3, 5])] == [0, 1, 2, 1, 1]


def test_a_graph_and_its_poc_set_have_the_same_dual() -> None:
    graph = PocGraph.from_implications(3, [(0, 2), (2, 4)])
    vertices = [v.tolist() for v in Cubing(graph).vertices()]
    assert vertices == [v.tolist() for v in Cubing(PocSet.from_graph(graph)).vertices()]
    given: Any = "a < b"
    with pytest.raises(
        InvalidValueError, match=r"^poc: must be a PocSet or a PocGraph"
    ):
        Cubing(given)


STAR = [f"a{k}" for k in range(300)]


@pytest.mark.parametrize(
    ("poc", "faces"),
    [
        pytest.param(chain("a", 500), (501, 500), id="a path"),
        pytest.param(chain("x", 11) | chain("y", 11), (144, 264, 121), id="a grid"),
        pytest.param(PocSet(STAR, exclusive(STAR)), (301, 300), id="a starfish"),
        pytest.param(PocSet(0), (1,), id="a point"),
    ],
)
def test_a_dual_of_many_sensors_is_listed_at_once(
    poc: PocSet, faces: tuple[int, ...]
) -> None:
    cubing = Cubing(poc)
    assert sum(1 for _ in cubing.vertices()) == faces[0]
    assert cubing.face_vector() == faces


def test_a_dual_too_large_to_list_is_refused() -> None:
    cubing = Cubing(PocSet(40))
    assert cubing.count() == 2**40
    assert next(cubing.vertices(limit=None))[::2].all()
    assert sum(1 for _ in Cubing(PocSet(11)).vertices(limit=2048)) == 2048
    message = "dual: must have at most 2047 vertices, or set limit=None, got 'more'"
    with pytest.raises(InvalidValueError, match=f"^{message}$"):
        list(Cubing(PocSet(11)).vertices(limit=2047))


def test_convex_sets_are_values() -> None:
    cubing = Cubing(PocSet.parse("a, b, c : a < b"))
    half = cubing.halfspace("a")
    assert half == cubing.convex_set([0]) == cubing.convex_set(half)
    assert hash(half) == hash(cubing.convex_set([0, 2]))
    assert half.literals.nonzero()[0].tolist() == [0, 2]
    assert half <= cubing.halfspace("b")
    assert not cubing.halfspace("b") <= half
    assert cubing.halfspace(cubing.poc.maximum) == cubing.convex_set([])
    empty = cubing.halfspace(cubing.poc.minimum)
    assert empty == half & cubing.halfspace("b*")
    assert (len(empty), list(empty), bool(empty)) == (0, [], False)
    assert half != "a"
    with pytest.raises(InvalidValueError, match=r"^convex set: must not be empty"):
        empty.first()
    nothing = Cubing(PocSet(0))
    assert nothing.distance([], []) == 0
    other = Cubing(PocSet(2)).convex_set([])
    mixed: list[Any] = [lambda: cubing.project(other, []), lambda: half & other]
    for mix in mixed:
        with pytest.raises(
            InvalidValueError, match=r"^convex set: must be of the same"
        ):
            mix()


@pytest.mark.parametrize(
    ("u", "message"),
    [
        ([0], "u: must be complete, with one literal of every sensor, got"),
        ([0, 3], "u: must be coherent, without a literal below another's complement"),
        ([0, 4], "u: must be a literal, a whole number in [0, 4), got 4"),
        (np.ones(3, bool), "u: must be (4,), got (3,)"),
    ],
)
def test_what_is_no_vertex_is_refused(u: Any, message: str) -> None:
    cubing = Cubing(PocSet.parse("a, b : a < b"))
    calls: list[Any] = [
        cubing.minimal,
        cubing.neighbours,
        cubing.cubes_at,
        lambda v: cubing.nearest(v, []),
        lambda v: cubing.geodesic(v, []),
        lambda v: cubing.flip(v, []),
    ]
    for call in calls:
        with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
            call(u)


def test_what_cannot_be_flipped_or_projected_to_is_refused() -> None:
    cubing = Cubing(PocSet.parse("a, b : a < b"))
    with pytest.raises(InvalidValueError, match=r"^literal: must be in u, got 'a\*'"):
        cubing.flip([0, 2], [1])
    with pytest.raises(InvalidValueError, match=r"^flipped: must be coherent"):
        cubing.flip([0, 2], [2])
    assert cubing.flip([0, 2], [0, 2]).nonzero()[0].tolist() == [1, 3]
    message = r"^onto: must be coherent: no vertex holds all of it, got 'a and b\*"
    with pytest.raises(InvalidValueError, match=message):
        cubing.project([], [0, 3])
    with pytest.raises(InvalidValueError, match=r"^k: must not be empty"):
        cubing.gate(cubing.convex_set([0, 3]), [])
    with pytest.raises(InvalidValueError, match=r"^vertices: must be at least one"):
        cubing.convex_hull([])
    with pytest.raises(ShapeError, match=r"^literals: must be \(4,\)"):
        cubing.convex_set(np.zeros(6, np.bool_))
