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
from tests.support.theory_strategies import Drawn, frozen, poc_sets


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
    identity = PocMorphism.named(second.p, second.p)
    assert all((identity.dual(u) == u).all() for u in far.vertices())
    assert identity @ f == f == f @ PocMorphism.named(first.p, first.p)
