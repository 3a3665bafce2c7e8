"""The duality of poc sets and median graphs, and morphisms, statement by statement.

Each test quotes the label of what it tests in the paper; where the text is wrong as
printed it says how it must read. `theory_oracles` has the definitions."""

import itertools

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.morphism import PocMorphism, canonical_projection
from neurosnap.poc.dual.realization import Realization, inclusions
from neurosnap.poc.order.pocset import Element, PocSet
from neurosnap.sensorium import Sensorium
from tests.support.edges import edges_of
from tests.support.hypothesis_settings import examples
from tests.support.paper_spaces import chain, exclusive
from tests.support.theory_oracles import Model, Vertex, face_counts
from tests.support.theory_strategies import (
    Drawn,
    array,
    fields,
    frozen,
    order_of,
    poc_sets,
    relations,
)


@given(poc_sets())
def test_defn_poc_set_the_order_is_what_the_relations_generate(drawn: Drawn) -> None:
    p, model = drawn.p, drawn.model
    for a in model.literals:
        assert p.leq(p.minimum, a)
        assert p.leq(a, p.maximum)
        assert not p.leq(a, p.minimum)
        assert p.negligible[a] == model.negligible(a)
        assert p.ubiquitous[a] == model.negligible(a ^ 1)
        assert p.proper[a] == model.proper(a)
        for b in model.literals:
            assert p.leq(a, b) == ((a, b) in model.order)
            assert p.equal(a, b) == model.equal(a, b)
    assert p.heads.tolist() == model.heads
    assert PocSet.parse(str(p)) == p
    assert order_of(p).order == model.order


@given(poc_sets())
def test_hasse_pairs(drawn: Drawn) -> None:
    p, model = drawn.p, drawn.model
    heads = sorted({model.head(a) for a in model.literals})
    strict = {(a, b) for a in heads for b in heads if a != b and p.leq(a, b)}
    assert set(p.hasse()) == {
        (a, b)
        for a, b in strict
        if not any((a, c) in strict and (c, b) in strict for c in heads)
    }


@given(poc_sets(6))
def test_defn_nesting_at_most_one_relation_and_an_empty_quadrant(drawn: Drawn) -> None:
    """[GK] defn:nesting and eqn:nesting relations, for elements of different sensors.

    As printed, of distinct elements, ``a`` and ``a*`` satisfy two of the four.
    """
    p, model = drawn.p, drawn.model
    for a, b in itertools.product(model.heads, repeat=2):
        assert p.crosses(a, b) == model.crosses(a, b)
        assert p.nested(a, b) != p.crosses(a, b)
        signs = itertools.product((a, a ^ 1), (b, b ^ 1))
        empty = [pair for pair in signs if not model.h(pair)]
        assert bool(empty) == p.nested(a, b)
        if a // 2 != b // 2:
            related = [p.leq(x, y) for x in (a, a ^ 1) for y in (b, b ^ 1)]
            assert sum(related) <= 1
            assert sum(related) == len(empty)
        else:
            assert p.leq(a, b) + p.leq(a ^ 1, b) + p.leq(a, b ^ 1) >= 1


@given(poc_sets())
def test_defn_dual_vertices_and_cubes(drawn: Drawn) -> None:
    """[GK] defn:dual: listed, counted and checked are the coherent selections."""
    model, cubing = drawn.model, drawn.cubing
    listed = [frozen(v) for v in cubing.vertices()]
    assert len(listed) == len(set(listed)) == cubing.count() == len(cubing)
    assert set(listed) == set(model.vertices)
    assert frozen(cubing.base()) == listed[0]
    cubes = model.cubes(model.vertices)
    assert cubing.face_vector() == face_counts(cubes)
    listed_cubes = [
        frozenset(
            frozen(cubing.flip(corner, some))
            for k in range(len(ways) + 1)
            for some in itertools.combinations(ways, k)
        )
        for corner, ways in cubing.cubes()
    ]
    assert len(listed_cubes) == len(set(listed_cubes))
    assert set(listed_cubes) == cubes


@given(poc_sets(6), st.data())
def test_lemma_flipping_and_where_cubes_come_from(
    drawn: Drawn, data: st.DataObject
) -> None:
    """[GK] lemma:flipping, lemma:where cubes come from; read: *proper* minimal ones.

    A ubiquitous literal with nothing below it in `u` is in min(u) as printed, but
    flipping it leaves the dual.
    """
    model, cubing = drawn.model, drawn.cubing
    u = data.draw(st.sampled_from(model.vertices))
    minimal = {
        a
        for a in u
        if model.proper(a)
        and not any((b, a) in model.order and not model.equal(a, b) for b in u)
    }
    assert frozen(cubing.minimal(array(u, model.n))) == minimal
    near = [frozen(v) for v in cubing.neighbours(array(u, model.n))]
    assert set(near) == set(model.joined[u])
    assert len(near) == len(model.joined[u])
    at = {frozenset(cube) for cube in cubing.cubes_at(array(u, model.n))}
    heads = sorted({model.head(a) for a in minimal})
    assert at == {
        frozenset(some)
        for k in range(len(heads) + 1)
        for some in itertools.combinations(heads, k)
        if all(model.crosses(a, b) for a, b in itertools.combinations(some, 2))
    }
    assert len(at) == sum(u in cube for cube in model.cubes(model.vertices))


def test_lemma_flipping_fails_as_printed_for_a_ubiquitous_literal() -> None:
    p = PocSet.parse("a, b : a <= a*")
    cubing = Cubing(p)
    assert not cubing.minimal([1, 2])[1]
    with pytest.raises(InvalidValueError, match=r"^flipped: must be coherent"):
        cubing.flip([1, 2], [1])


@given(poc_sets(6))
def test_lemma_ellone_metric_is_hop_metric(drawn: Drawn) -> None:
    model, cubing = drawn.model, drawn.cubing
    for u, v in itertools.product(model.vertices[:12], model.vertices):
        assert model.hops[u][v] == len(model.apart(u, v))
        here, there = array(u, model.n), array(v, model.n)
        assert cubing.distance(here, there) == model.hops[u][v]


@given(poc_sets(6), st.data())
def test_eqn_median_formula(drawn: Drawn, data: st.DataObject) -> None:
    model, cubing = drawn.model, drawn.cubing
    u, v, w = (data.draw(st.sampled_from(model.vertices)) for _ in range(3))
    median = cubing.median(*(array(x, model.n) for x in (u, v, w)))
    assert model.medians(u, v, w) == {frozen(median)}
    assert frozen(median) == (u & v) | (u & w) | (v & w)


def half_spaces(model: Model) -> set[frozenset[Vertex]]:
    """The convex sets with convex complements, by looking at all sets of vertices."""
    everything = frozenset(model.vertices)
    listed = model.vertices
    found = set()
    for bits in itertools.product((0, 1), repeat=len(listed)):
        side = frozenset(u for u, bit in zip(listed, bits, strict=True) if bit)
        if model.convex(side) and model.convex(everything - side):
            found.add(side)
    return found


@examples(40)
@given(poc_sets(4))
def test_lemma_ellone_halfspaces(drawn: Drawn) -> None:
    model, cubing = drawn.model, drawn.cubing
    assume(len(model.vertices) <= 9)
    elements: list[Element] = [*model.literals, drawn.p.minimum, drawn.p.maximum]
    listed = {frozenset(map(frozen, cubing.halfspace(a))) for a in elements}
    assert listed == half_spaces(model)
    for a in model.literals:
        other = frozenset(map(frozen, cubing.halfspace(a ^ 1)))
        assert other == frozenset(model.vertices) - model.h([a])


@given(poc_sets(5))
def test_cor_reconstruction(drawn: Drawn) -> None:
    """[GK] cor:reconstruction: ``a -> h(a)`` is an isomorphism from the quotient."""
    p = canonical_projection(drawn.p).target
    shown = np.array(list(Cubing(p).vertices())).T[::2]
    assert Realization(shown, p.sensorium).poc_set() == p


@st.composite
def median_graphs(draw: st.DrawFn) -> nx.Graph:
    """Draw a tree, or a product of two."""
    graph = nx.Graph([(0, 1)])
    for k in range(2, draw(st.integers(2, 6))):
        graph.add_edge(k, draw(st.integers(0, k - 1)))
    if draw(st.booleans()):
        graph = nx.cartesian_product(graph, nx.path_graph(draw(st.integers(1, 3))))
    return graph


@given(median_graphs())
def test_thm_every_median_graph_is_a_poc_dual(graph: nx.Graph) -> None:
    """[GK] thm:every median graph is a poc dual, that of its half-spaces.

    For an edge ``xy`` they are the vertices nearer to ``x`` than to ``y``, and the
    others.
    """
    hops = dict(nx.all_pairs_shortest_path_length(graph))
    sides = {tuple(hops[z][x] < hops[z][y] for z in graph) for x, y in graph.edges}
    chosen = {
        side for side in sides if side[0] or tuple(not z for z in side) not in sides
    }
    shown = Realization(sorted(chosen))
    cubing = Cubing(shown.poc_set())
    assert cubing.count() == len(graph)
    for (x, one), (y, other) in itertools.combinations(enumerate(graph), 2):
        found = cubing.distance(shown.vertex(x), shown.vertex(y))
        assert found == hops[one][other]


@given(relations(4), relations(3))
def test_eqn_direct_sum_duals_multiply(left: Drawn, right: Drawn) -> None:
    """[GK] defn:direct sum, eqn:direct sum."""
    other = PocSet.from_graph(
        right.p.graph, Sensorium(f"t{k}" for k in range(len(right.p)))
    )
    total = left.p | other
    here = left.p.minimum
    for a, b in itertools.product(range(total.minimum), repeat=2):
        if (a < here) == (b < here):
            own = left.p if a < here else other
            shift = 0 if a < here else here
            assert total.leq(a, b) == own.leq(a - shift, b - shift)
        else:
            assert not total.leq(a, b)
    product = np.convolve(left.cubing.face_vector(), Cubing(other).face_vector())
    assert Cubing(total).face_vector() == tuple(product.tolist())
    listed = {frozen(v) for v in Cubing(total).vertices()}
    assert listed == {
        u | {a + here for a in v}
        for u in left.model.vertices
        for v in right.model.vertices
    }


@given(poc_sets(6), st.data())
def test_prop_representing_in_product(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] prop:representing in product: a median-preserving embedding of complexes."""
    names = drawn.p.sensorium.names
    actions = data.draw(st.sets(st.sampled_from(names))) if names else set()
    rest = [name for name in names if name not in actions]
    parts = drawn.p.restricted(sorted(actions)) | drawn.p.restricted(rest)
    f = PocMorphism.named(parts, drawn.p)
    here, product = drawn.cubing, Cubing(f.source)
    images = {v.tobytes(): f.dual(v) for v in here.vertices()}
    assert len({image.tobytes() for image in images.values()}) == len(images)
    for corner, ways in itertools.islice(here.cubes(), 60):
        moved = {names[a // 2] for a in ways}
        source = f.source.sensorium
        sent = images[corner.tobytes()]
        flipped = [source.literal(n) + (not sent[source.literal(n)]) for n in moved]
        assert product.is_vertex(product.flip(sent, flipped))
    triple = [data.draw(st.sampled_from(list(here.vertices()))) for _ in range(3)]
    median = f.dual(here.median(*triple))
    assert (median == product.median(*(f.dual(u) for u in triple))).all()


@given(poc_sets(6), st.data())
def test_the_parts_of_the_product_are_reached(
    drawn: Drawn, data: st.DataObject
) -> None:
    """[GK] the two surjections before eqn:representing in product."""
    names = drawn.p.sensorium.names
    kept = sorted(data.draw(st.sets(st.sampled_from(names)))) if names else []
    inclusion = PocMorphism.named(drawn.p.restricted(kept), drawn.p)
    reached = {inclusion.dual(u).tobytes() for u in drawn.cubing.vertices()}
    part = Cubing(inclusion.source)
    assert reached == {v.tobytes() for v in part.vertices()}


@given(poc_sets(5), st.data())
def test_prop_some_dual_properties(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] prop:some dual properties: a degeneration's dual embeds the complex.

    That the image is a strong deformation retract follows from both being
    contractible, which is tested where homology is.
    """
    p = drawn.p
    assume(len(p))
    extra = [
        (
            data.draw(st.integers(0, p.minimum - 1)),
            data.draw(st.integers(0, p.minimum - 1)),
        )
        for _ in range(2)
    ]
    edges = sorted(edges_of(p.order))
    try:
        more = PocSet(p.sensorium, [*edges, *extra])
    except InvalidValueError:
        assume(False)
    f = PocMorphism.named(p, more)
    assert f.is_surjective
    here, there = Cubing(more), drawn.cubing
    images = {v.tobytes(): f.dual(v) for v in here.vertices()}
    assert len({image.tobytes() for image in images.values()}) == len(images)
    if f.is_bijective:
        for corner, ways in itertools.islice(here.cubes(), 60):
            sent = there.flip(images[corner.tobytes()], ways)
            assert (sent == here.flip(corner, ways)).all()
    if more != p:
        with pytest.raises(InvalidValueError, match=r"^morphism: must keep"):
            PocMorphism.named(more, p)


@given(fields(5, 6))
def test_the_dual_holds_what_realizations_show_and_nothing_less(
    rows: list[list[bool]],
) -> None:
    """[GK] the corollary after defn:punctured dual."""
    realization = Realization(rows)
    p = realization.poc_set()
    cubing = Cubing(p)
    for point in range(len(rows[0])):
        assert cubing.is_vertex(realization.vertex(point))
    points = list(cubing.vertices())
    canonical = Realization(np.array(points)[:, ::2].T, p.sensorium)
    assert not (p.order & ~inclusions(canonical.fields)).any()
    assert {v.tobytes() for v in canonical.vertices(p)} == {v.tobytes() for v in points}


@given(st.integers(1, 12))
def test_example_n_path_thresholds_and_beacons(length: int) -> None:
    """[GK] example:N-path, with its vertices and its relations as they must read.

    ``v_k`` holds ``a_j*`` for j <= k and ``a_i`` for i > k; beacons exclude each other
    up to the last one, j <= N.
    """
    path = Cubing(chain("a", length))
    assert path.face_vector() == (length + 1, length)
    vertices = [
        array({2 * j + (j < k) for j in range(length)}, 2 * length)
        for k in range(length + 1)
    ]
    assert {v.tobytes() for v in path.vertices()} == {v.tobytes() for v in vertices}
    for k, u in enumerate(vertices):
        assert [path.distance(u, v) for v in vertices] == [
            abs(k - j) for j in range(length + 1)
        ]
    names = [f"a{k}" for k in range(length)]
    star = Cubing(PocSet(names, exclusive(names)))
    assert star.face_vector() == (length + 1, length)
    middle = array({2 * j + 1 for j in range(length)}, 2 * length)
    assert len(list(star.neighbours(middle))) == length
    if length > 1:
        printed = Cubing(PocSet(names, exclusive(names[:-1])))
        assert printed.count() == 2 * length


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
