"""Punctured duals, homology and the homotopy theorem; see `test_theory`."""

import itertools
from collections.abc import Callable, Iterable

import gudhi
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.realization import Realization, inclusions
from neurosnap.poc.order.pocset import PocSet
from tests.support.hypothesis_settings import examples
from tests.support.paper_spaces import (
    Example,
    grid_with_holes,
    six_arcs,
    six_wide_arcs,
    thresholds,
)
from tests.support.theory_oracles import Model, face_counts, included
from tests.support.theory_strategies import Drawn, fields, frozen, poc_sets


def trimmed(numbers: tuple[int, ...]) -> tuple[int, ...]:
    """Betti numbers without the zeros at the end."""
    kept = list(numbers)
    while kept and not kept[-1]:
        kept.pop()
    return tuple(kept)


def betti(cubes: Iterable[tuple[int, ...]]) -> tuple[int, ...]:
    """Betti numbers over GF(2) of cubes, each cut into its ascending paths."""
    tree = gudhi.SimplexTree()
    for cube in cubes:
        ways = [1 << k for k in range(len(cube).bit_length() - 1)]
        for path in itertools.permutations(ways):
            tree.insert([cube[p] for p in itertools.accumulate(path, initial=0)])
    tree.compute_persistence(homology_coeff_field=2, persistence_dim_max=True)
    return trimmed(tuple(tree.betti_numbers()))


def spanned(
    poc: PocSet, vertices: Iterable[NDArray[np.bool_]]
) -> list[tuple[int, ...]]:
    """The cubes of the dual of `poc` all of whose vertices are among some."""
    rows = np.array(list(vertices))[:, ::2].T
    return Realization(rows, poc.sensorium).punctured(poc)


@examples(60)
@given(poc_sets(6))
def test_cor_cubings_are_contractible(drawn: Drawn) -> None:
    """[GK] cor:cubings are contractible, and prop:some dual properties, point 3."""
    assume(len(drawn.p))
    dual = spanned(drawn.p, drawn.cubing.vertices())
    assert face_counts(dual) == drawn.cubing.face_vector()
    assert betti(dual) == (1,)


@given(fields(6))
def test_defn_punctured_dual(rows: list[list[bool]]) -> None:
    """[GK] defn:consistent vertices, defn:punctured dual."""
    realization, model = Realization(rows), Model(2 * len(rows), included(rows))
    shown = {
        frozenset(2 * s + (not row[x]) for s, row in enumerate(rows))
        for x in range(len(rows[0]))
    }
    vertices = list(map(frozen, realization.vertices()))
    assert set(vertices) == shown <= set(model.vertices)
    cubes = [[vertices[v] for v in cube] for cube in realization.punctured()]
    assert sorted(cubes, key=len) == cubes
    assert len(cubes) == len(wanted := model.cubes(shown))
    assert {frozenset(cube) for cube in cubes} == wanted
    for first, *others in cubes:
        # What is off at each place, and on at the first.
        off = [frozenset[int](), *(first - other for other in others)]
        assert all(off[p] == off[p & -p] | off[p & p - 1] for p in range(len(off)))
        assert all(min(literals) % 2 == 0 for literals in off[1:])
    for u in realization.vertices():
        for x in np.flatnonzero(realization.witnesses(u)):
            assert (realization.vertex(int(x)) == u).all()


def test_thm_homotopy_type_asks_the_impossible_as_printed() -> None:
    """[GK] thm:homotopy type, its condition 2.

    In a connected space some sets of witnesses of different vertices have no disjoint
    open neighbourhoods, for the thresholds on a path as for anything else: the
    smallest ones meet although the sets do not.
    """
    path = thresholds(3)
    cells, shown = [set(cell) for cell in path.cells], path.realization
    sets = [shown.witnesses(u) for u in shown.vertices(path.poc)]
    # A cell is in the closure of another iff its vertices are among the other's.
    around = np.array([[cell <= other for other in cells] for cell in cells])
    stars = [around[points].any(axis=0) for points in sets]
    pairs = list(itertools.combinations(range(len(sets)), 2))
    assert not any((sets[j] & sets[k]).any() for j, k in pairs)
    assert any((stars[j] & stars[k]).any() for j, k in pairs)


@pytest.mark.parametrize("make", [six_arcs, six_wide_arcs])
def test_thm_homotopy_type_six_arcs_carry_the_circle(
    make: Callable[[], Example],
) -> None:
    """[GK] example:N-cycle, fig:six way compass."""
    example = make()
    assert betti(spanned(example.poc, Cubing(example.poc).vertices())) == (1,)
    assert betti(example.realization.punctured(example.poc)) == (1, 1)
    assert betti(example.cells) == (1, 1)


def without(example: str) -> tuple[int, ...]:
    """The Betti numbers of a compass without its marked vertex alone."""
    compass = {"narrow": six_arcs, "wide": six_wide_arcs}[example]()
    gone = compass.mark()
    kept = [u for u in Cubing(compass.poc).vertices() if (u != gone).any()]
    return betti(spanned(compass.poc, kept))


def test_deleting_one_vertex_makes_a_circle_of_the_narrow_arcs_only() -> None:
    """[GK] after thm:homotopy type: "from either" must read "from the first".

    The dual of the wide arcs is a block of eight cubes; without its middle it is a
    sphere. All its inconsistent vertices have to go.
    """
    assert without("narrow") == (1, 1)
    assert without("wide") == (1, 0, 1)


def test_the_narrow_arcs_have_the_wide_arcs_dual_less_the_white_vertices() -> None:
    """[GK] fig:six way compass: 13 black vertices and 14 white ones, eight cubes."""
    narrow, wide = Cubing(six_arcs().poc), Cubing(six_wide_arcs().poc)
    assert narrow.face_vector() == (13, 18, 6)
    assert wide.face_vector() == (27, 54, 36, 8)
    assert {v.tobytes() for v in narrow.vertices()} <= {
        v.tobytes() for v in wide.vertices()
    }
    for arcs, other, kept in (
        (six_arcs, six_wide_arcs, True),
        (six_wide_arcs, six_arcs, False),
    ):
        held = inclusions(arcs().realization.fields)
        assert (other().poc.order <= held).all() == kept


@examples(25)
@given(st.sets(st.tuples(st.integers(0, 4), st.integers(0, 4)), max_size=5))
def test_thm_homotopy_type_grids_with_holes(holes: set[tuple[int, int]]) -> None:
    example = grid_with_holes(5, 5, tuple(sorted(holes)))
    inner = example.realization.punctured(example.poc)
    assert face_counts(inner)[0] == 25 - len(holes)
    assert betti(inner) == by_pixels(holes)
    whole = Cubing(example.poc)
    assert whole.face_vector() == (25, 40, 16)


def by_pixels(holes: set[tuple[int, int]]) -> tuple[int, ...]:
    """Betti numbers of the grid as gudhi has them, from a picture of its vertices."""
    present = np.array([[(x, y) not in holes for y in range(5)] for x in range(5)])
    vertices = gudhi.CubicalComplex(vertices=np.where(present, 0.0, 9.0))
    vertices.compute_persistence(homology_coeff_field=2)
    return trimmed(tuple(vertices.persistent_betti_numbers(1.0, 1.0)))
