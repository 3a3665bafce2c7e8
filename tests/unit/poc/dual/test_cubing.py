"""Cubings, realisations and morphisms: what they are made of, and invalid input."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError, UnknownSensorError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.morphism import PocMorphism, canonical_projection
from neurosnap.poc.dual.realization import Realization
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


FIELDS = [[1, 1, 0, 0], [0, 1, 1, 0]]


def test_points_show_vertices_and_vertices_have_witnesses() -> None:
    shown = Realization(FIELDS, ["a", "b"])
    assert str(shown.poc_set()) == "a, b"
    assert shown.vertex(1).nonzero()[0].tolist() == [0, 2]
    assert len(shown.vertices()) == 4
    assert shown.witnesses([0]).tolist() == [True, True, False, False]
    assert shown.witnesses([0, 3]).tolist() == [True, False, False, False]
    assert shown.witnesses([0, 1]).tolist() == [False] * 4
    *cubes, square = shown.punctured()
    assert (len(cubes), square) == (8, (1, 2, 0, 3))


def test_points_that_break_a_relation_leave_the_dual() -> None:
    """[GK] defn:punctured dual: consistent vertices that are in the dual."""
    shown = Realization(FIELDS, ["a", "b"])
    believed = PocSet.parse("a, b : a < b*")
    assert len(shown.vertices(believed)) == 3
    assert shown.punctured(believed) == [(0,), (1,), (2,), (0, 2), (1, 2)]
    with pytest.raises(InvalidValueError, match=r"^poc set: must be on \['a', 'b'\]"):
        shown.vertices(PocSet.parse("a, c"))


def test_fields_cannot_be_changed() -> None:
    given = np.array(FIELDS, np.bool_)
    shown = Realization(given)
    given[:] = False
    assert shown.fields.any()
    assert not shown.fields.flags.writeable
    assert shown.sensorium.names == ("s0", "s1")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[1, 0], [1]],), "field of s1: must have 2 points as the first has, got (1"),
        (([[1, 0], [1, 2]], ["a", "b"]), "field of b: must be made of bits, 0 or 1"),
        (([[]],), "fields: must be over at least one point, got (1, 0)"),
        (([[1]], ["a", "b"]), "fields: must be 2, one a sensor, got 1"),
        (([["x"]],), "field of s0: must be made of bits, 0 or 1, got ['x']"),
        (("ab",), "fields: must be one row of bits a sensor, got 'ab'"),
        (([3],), "field of s0: must have 0 points as the first has, got ()"),
    ],
)
def test_bad_realizations_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
        Realization(*arguments)


@pytest.mark.parametrize("point", [4, -1, "x", True, None])
def test_unknown_points_are_refused(point: Any) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^point: must be the number of one of 4"
    ):
        Realization(FIELDS).vertex(point)


P = PocSet.parse("a, b : a < b")
Q = PocSet.parse("x, y : x* < y")


def test_a_partial_assignment_extends_in_one_way() -> None:
    """[GK] the end of example:generators and relations."""
    f = PocMorphism(P, PocSet.parse("a, b : a* < b"), ["a*", "b"])
    assert [f(name) for name in ("a", "a*", "b", "b*")] == ["a*", "a", "b", "b*"]
    assert (f(P.minimum), f(P.maximum)) == ("0", "1")
    assert f.is_isomorphism


def test_the_failing_pair_is_named() -> None:
    message = "morphism: must keep the order, and a <= b, got 'x not <= y'"
    with pytest.raises(InvalidValueError, match=re.escape(message)):
        PocMorphism(P, Q, ["x", "y"])
    with pytest.raises(InvalidValueError, match=r"a <= b, got '1 not <= x'"):
        PocMorphism(P, Q, [Q.maximum, "x"])


@pytest.mark.parametrize(
    ("images", "message"),
    [
        (["x"], "images: must be 2, one a sensor, got 1"),
        (["x", "z"], "literal: must name a sensor that exists, got 'z'"),
        (["x", 6], "element: must be a literal, a whole number in [0, 6), got 6"),
    ],
)
def test_bad_images_are_refused(images: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
        PocMorphism(P, Q, images)


def test_compositions_need_matching_ends() -> None:
    f = PocMorphism(P, Q, ["x*", "y"])
    g = PocMorphism(Q, PocSet(0), [1, 1])
    assert (g @ f)("a") == "0"
    assert (g @ f)("b") == "1"
    with pytest.raises(InvalidValueError, match=r"^morphism: must go to"):
        f @ g
    with pytest.raises(InvalidValueError, match=r"^u: must be complete"):
        f.dual([0])


def test_a_degeneration_only_adds_relations() -> None:
    """[GK] example:degeneration: its inverse is no morphism."""
    f = PocMorphism.named(
        PocSet.parse("a, b, c : a < c, b < c"), PocSet.parse("a, b, c : a < b < c")
    )
    assert f.is_bijective
    assert not f.is_isomorphism
    with pytest.raises(InvalidValueError, match=r"^morphism: must keep .* a <= b"):
        PocMorphism.named(f.target, f.source)
    with pytest.raises(UnknownSensorError):
        PocMorphism.named(P, PocSet.parse("a"))


def test_the_dual_of_the_bad_morphism_sends_an_edge_to_a_diagonal() -> None:
    """[GK] example:bad dual, with ``a < c`` for the printed ``a < b``.

    As printed the poc set is a chain, whose dual has no square to have a diagonal.
    """
    source, target = (
        PocSet.parse("a, b, c : a < c, b < c"),
        PocSet.parse("x, y : x < y"),
    )
    f = PocMorphism(source, target, ["x", "x", "y"])
    here, there = Cubing(f.target), Cubing(f.source)
    (corner, (x,)) = next(cube for cube in here.cubes(1) if cube[1] == (0,))
    u, v = f.dual(corner), f.dual(here.flip(corner, [x]))
    assert there.distance(u, v) == 2
    assert there.interval(u, v).count() == 4
    printed = Cubing(PocSet.parse("a, b, c : a < b, b < c"))
    assert printed.face_vector() == (4, 3)


def test_the_canonical_projection_drops_and_merges() -> None:
    f = canonical_projection(PocSet.parse("a, b, c, d : a < a*, b = c*, d* < d"))
    assert str(f.target) == "b"
    assert [f(n) for n in ("a", "b", "c", "d")] == ["0", "b", "b*", "1"]
    assert f.is_surjective
    assert not f.is_injective
    assert f == canonical_projection(f.source)
