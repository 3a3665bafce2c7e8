"""Morphisms: their conditions, their maps of duals, and invalid input."""

import re
from typing import Any

import pytest

from neurosnap.errors import InvalidValueError, UnknownSensorError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.morphism import PocMorphism, canonical_projection
from neurosnap.poc.order.pocset import PocSet

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
