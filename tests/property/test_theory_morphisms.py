"""Morphisms of poc sets and the maps between their duals, statement by statement.

Each test quotes the label of what it tests in the paper. `theory_oracles` has the
definitions.
"""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.morphism import PocMorphism, canonical_projection
from neurosnap.poc.order.pocset import PocSet
from tests.support.hypothesis_settings import examples
from tests.support.theory_strategies import Drawn, array, frozen, order_of, poc_sets


def morphisms(p: PocSet, q: PocSet) -> list[PocMorphism]:
    """All morphisms, by trying every image of every sensor."""
    found = []
    for images in itertools.product(range(q.minimum + 2), repeat=len(p)):
        sent = [image ^ k for image in images for k in (0, 1)]
        kept = all(q.leq(sent[a], sent[b]) for a, b in np.argwhere(p.order).tolist())
        if kept:
            found.append(PocMorphism(p, q, images))
        else:
            with pytest.raises(InvalidValueError, match=r"^morphism: must keep"):
                PocMorphism(p, q, images)
    return found


def distinct(found: list[PocMorphism]) -> list[PocMorphism]:
    """Those that differ in more than the names of equal elements."""
    different: list[PocMorphism] = []
    for f in found:
        if f not in different:
            different.append(f)
    return different


@examples(50)
@given(poc_sets(3), poc_sets(2))
def test_lemma_canonical_poc_quotient_factors_every_morphism_once(
    source: Drawn, target: Drawn
) -> None:
    p, q = source.p, canonical_projection(target.p).target
    projection = canonical_projection(p)
    assert not projection.target.negligible.any()
    through = morphisms(projection.target, q)
    for f in morphisms(p, q):
        assert sum(g @ projection == f for g in through) == 1


@given(poc_sets(6))
def test_lemma_reduction_to_poc_sets(drawn: Drawn) -> None:
    """[GK] lemma:reduction to poc sets: the quotient's dual is the same cubing."""
    projection = canonical_projection(drawn.p)
    small, large = Cubing(projection.target), drawn.cubing
    pulled = [frozen(projection.dual(u)) for u in small.vertices()]
    assert sorted(map(sorted, pulled)) == sorted(map(sorted, drawn.model.vertices))
    assert small.face_vector() == large.face_vector()
    vertices = list(small.vertices())
    for u, v in itertools.islice(itertools.combinations(vertices, 2), 40):
        images = projection.dual(u), projection.dual(v)
        assert large.distance(*images) == small.distance(u, v)


@given(poc_sets(3))
def test_vertices_are_the_morphisms_onto_the_minimal_poc_set(drawn: Drawn) -> None:
    """[GK] the remark after example:simple example of a dual."""
    two = PocSet(0)
    onto = {
        frozenset(np.flatnonzero(f.images == two.maximum).tolist())
        for f in morphisms(drawn.p, two)
    }
    assert onto == set(drawn.model.vertices)


@examples(40)
@given(poc_sets(2), poc_sets(2), poc_sets(2), st.data())
def test_defn_dual_map_preserves_medians_and_turns_compositions(
    first: Drawn, second: Drawn, third: Drawn, data: st.DataObject
) -> None:
    """[GK] defn:dual map, eqn:median preserving and the functor."""
    f = data.draw(st.sampled_from(morphisms(first.p, second.p)))
    g = data.draw(st.sampled_from(morphisms(second.p, third.p)))
    near, far = Cubing(first.p), Cubing(second.p)
    for u in Cubing(third.p).vertices():
        assert ((g @ f).dual(u) == f.dual(g.dual(u))).all()
    for u, v, w in itertools.product(list(far.vertices()), repeat=3):
        images = [f.dual(x) for x in (u, v, w)]
        assert (f.dual(far.median(u, v, w)) == near.median(*images)).all()
    identity = PocMorphism.identity(second.p)
    assert all((identity.dual(u) == u).all() for u in far.vertices())
    assert identity @ f == f == f @ PocMorphism.identity(first.p)


@examples(40)
@given(poc_sets(2), poc_sets(2))
def test_duality_morphisms_are_the_median_maps_between_the_duals(
    first: Drawn, second: Drawn
) -> None:
    """[GK] subsection:duality theory, at the level of maps, for poc sets."""
    p, q = canonical_projection(first.p).target, canonical_projection(second.p).target
    near, far = order_of(p), order_of(q)
    medians = {
        triple: next(iter(near.medians(*triple)))
        for triple in itertools.product(near.vertices, repeat=3)
    }
    triples = list(itertools.product(far.vertices, repeat=3))
    maps = set()
    for images in itertools.product(near.vertices, repeat=len(far.vertices)):
        sent = dict(zip(far.vertices, images, strict=True))
        if all(
            sent[next(iter(far.medians(*t)))]
            == medians[sent[t[0]], sent[t[1]], sent[t[2]]]
            for t in triples
        ):
            maps.add(images)
    duals = [
        tuple(frozen(f.dual(array(u, q.minimum))) for u in far.vertices)
        for f in distinct(morphisms(p, q))
    ]
    assert len(duals) == len(set(duals))
    assert set(duals) == maps
