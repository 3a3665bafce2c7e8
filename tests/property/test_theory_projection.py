"""Convexity, gates and projections, statement by statement; see `test_theory`."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import ConvexSet, Cubing
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from tests.support import oracles
from tests.support.hypothesis_settings import examples
from tests.support.strategies import bit_rows
from tests.support.theory_oracles import Model, Vertex, Vertices, subsets
from tests.support.theory_strategies import (
    Drawn,
    array,
    coherent_sets,
    frozen,
    poc_sets,
    sets_of,
)


def listed(convex: ConvexSet) -> Vertices:
    """The vertices of a convex set, as the oracle has them."""
    vertices = frozenset(frozen(v) for v in convex)
    assert len(vertices) == len(convex)
    assert convex.is_empty == (not vertices)
    return vertices


def vertex(data: st.DataObject, model: Model) -> Vertex:
    return data.draw(st.sampled_from(model.vertices))


@given(poc_sets(6), st.data())
def test_convex_sets_intervals_and_hulls(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] eqn:typical convex set, defn:hop distance."""
    model, cubing = drawn.model, drawn.cubing
    wanted, more = data.draw(sets_of(model)), data.draw(sets_of(model))
    convex, other = cubing.convex_set(wanted), cubing.convex_set(more)
    assert listed(convex) == model.h(wanted)
    assert listed(convex & other) == model.h(wanted | more)
    assert (convex <= other) == (model.h(wanted) <= model.h(more))
    assert (convex == other) == (model.h(wanted) == model.h(more))
    u, v = vertex(data, model), vertex(data, model)
    here, there = array(u, model.n), array(v, model.n)
    assert listed(cubing.interval(here, there)) == model.interval(u, v)
    assert (here in convex) == (u in model.h(wanted))
    some = data.draw(st.sets(st.sampled_from(model.vertices), min_size=1, max_size=4))
    hull = cubing.convex_hull([array(w, model.n) for w in some])
    assert listed(hull) == model.hull(frozenset(some))


@examples(40)
@given(poc_sets(4))
def test_thm_convexity_1_convex_sets_are_intersections_of_halfspaces(
    drawn: Drawn,
) -> None:
    """[GK] thm:convexity theory of median graphs, point 1: they are the h(B)."""
    model, cubing = drawn.model, drawn.cubing
    assume(len(model.vertices) <= 9)
    for chosen in subsets(model.vertices):
        if chosen and model.convex(chosen):
            shared = frozenset.intersection(*chosen)
            assert listed(cubing.convex_set(shared)) == chosen


@given(poc_sets(6), st.data())
def test_thm_convexity_2_helly(drawn: Drawn, data: st.DataObject) -> None:
    model, cubing = drawn.model, drawn.cubing
    family = data.draw(st.lists(coherent_sets(model), min_size=1, max_size=4))
    sets = [cubing.convex_set(b) for b in family]
    meet = all(not (k & m).is_empty for k, m in itertools.combinations(sets, 2))
    common = cubing.convex_set(set().union(*family))
    assert meet == (not common.is_empty)
    assert bool(model.h(set().union(*family))) == meet


@given(poc_sets(5), st.data())
def test_thm_convexity_3_convex_subgraphs_are_median(
    drawn: Drawn, data: st.DataObject
) -> None:
    """Point 3: the medians of a convex set are in it, and so is a path between any."""
    model, cubing = drawn.model, drawn.cubing
    inside = sorted(model.h(data.draw(coherent_sets(model))), key=sorted)
    u, v, w = (data.draw(st.sampled_from(inside)) for _ in range(3))
    median = cubing.median(*(array(x, model.n) for x in (u, v, w)))
    assert frozen(median) in inside
    assert model.interval(u, v) <= set(inside)


@given(poc_sets(6), st.data())
def test_thm_convexity_4_and_cor_projection_of_a_point(
    drawn: Drawn, data: st.DataObject
) -> None:
    """Point 4, one closest vertex; [GK] cor:projection of a point, its formula."""
    model, cubing = drawn.model, drawn.cubing
    u, target = vertex(data, model), data.draw(coherent_sets(model))
    nearest = cubing.nearest(array(u, model.n), target)
    assert model.nearest(u, model.h(target)) == {frozen(nearest)}
    above = model.up(target)
    against = oracles.stars(above)
    assert (u - against) | above == (u | above) - against == frozen(nearest)


@given(poc_sets(5), st.data())
def test_thm_convexity_5_projection_is_a_median_map_that_stretches_nothing(
    drawn: Drawn, data: st.DataObject
) -> None:
    model, cubing = drawn.model, drawn.cubing
    target = data.draw(coherent_sets(model))
    triple = [array(vertex(data, model), model.n) for _ in range(3)]
    images = [cubing.nearest(x, target) for x in triple]
    for (u, p), (v, q) in itertools.combinations(zip(triple, images, strict=True), 2):
        assert cubing.distance(p, q) <= cubing.distance(u, v)
    moved = cubing.nearest(cubing.median(*triple), target)
    assert (moved == cubing.median(*images)).all()


@given(poc_sets(6), st.data())
def test_lemma_supporting_halfspace(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] lemma:supporting halfspace; read: for `a` that is not ubiquitous.

    A ubiquitous literal supports every set, and nothing of ``S`` need be below it.
    """
    model = drawn.model
    chosen = data.draw(coherent_sets(model))
    for a in model.literals:
        if not model.negligible(a ^ 1):
            supports = model.h(chosen) <= model.h([a])
            assert supports == any((s, a) in model.order for s in chosen)


@given(poc_sets(6), st.data())
def test_prop_gates_exist(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] prop:gates exist, eqn:separator."""
    model, cubing = drawn.model, drawn.cubing
    s, t = data.draw(coherent_sets(model)), data.draw(coherent_sets(model))
    k, m = model.h(s), model.h(t)
    apart = model.separators(k, m)
    separators = frozen(cubing.separators(s, t))
    assert {model.head(a) for a in separators} == apart
    u, v = map(frozen, cubing.gate(s, t))
    assert u in k
    assert v in m
    assert model.hops[u][v] == len(apart)
    for x, y in itertools.islice(itertools.product(k, m), 200):
        assert model.hops[x][y] >= len(apart)
        gate = model.hops[x][y] == len(apart)
        assert gate == (model.nearest(y, k) == {x} and model.nearest(x, m) == {y})


@given(poc_sets(6), st.data())
def test_prop_general_projection(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] prop:general projection and lemma:general projection, intersecting."""
    model, cubing = drawn.model, drawn.cubing
    s, t = data.draw(coherent_sets(model)), data.draw(coherent_sets(model))
    source, goal = model.h(s), model.h(t)
    projected = model.projection(source, goal)
    assert listed(cubing.project(s, t)) == projected
    above, against = model.up(t), oracles.stars(model.up(t))
    assert model.h((model.up(s) | above) - against) == projected
    assert goal & model.h(model.up(s) - against) == projected
    if source & goal:
        assert projected == source & goal


@given(poc_sets(6), st.data())
def test_prop_constructing_geodesics(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] prop:constructing geodesics, to convex sets and to vertices."""
    model, cubing = drawn.model, drawn.cubing
    u, target = vertex(data, model), data.draw(coherent_sets(model))
    goals: list[Vertex | set[int]] = [target, vertex(data, model)]
    for goal in goals:
        path = [frozen(v) for v in cubing.geodesic(array(u, model.n), goal)]
        (end,) = model.nearest(u, model.h(goal))
        assert path[0] == u
        assert path[-1] == end
        assert len(path) == model.hops[u][end] + 1
        assert all(b in model.joined[a] for a, b in itertools.pairwise(path))


@given(poc_sets(6), st.data())
def test_prop_coherent_projection_four_points(
    drawn: Drawn, data: st.DataObject
) -> None:
    """[GK] prop:coherent projection; also that what it gives is coherent."""
    model, graph = drawn.model, drawn.p.graph
    chosen, u = data.draw(sets_of(model)), vertex(data, model)
    above = model.up(chosen)
    projected = frozen(graph.coherent_projection(chosen))
    assert frozen(graph.up(chosen)) == above
    assert projected == above - oracles.stars(above)
    assert model.coherent(projected)
    assert graph.is_coherent(chosen) == model.coherent(chosen)
    if model.coherent(chosen):
        assert projected == above
    assert model.up(projected) == projected
    assert frozen(graph.coherent_projection(projected)) == projected
    assert frozen(graph.coherent_projection(u)) == u == model.up(u)


@given(poc_sets(6), st.data())
def test_lemma_propagation_gives_coherent_projection(
    drawn: Drawn, data: st.DataObject
) -> None:
    """[GK] lemma:propagation gives coherent projection, for any observation."""
    graph = drawn.p.graph
    bits = data.draw(bit_rows(len(drawn.p)))
    observation = [2 * k + (not bit) for k, bit in enumerate(bits)]
    state = graph.propagate([], observation)
    assert (state == graph.coherent_projection(observation)).all()
    possible = drawn.cubing.convex_set(state)
    assert listed(possible) == drawn.model.h(frozen(state))
    assert not possible.is_empty


@given(poc_sets(6), st.data())
def test_alg_propagation_by_dfs(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] alg:propagation_by_DFS, for a load that holds all above it, as states do.

    It adds the load as it is, while defn:propagation algorithm adds all above it too.
    """
    model, graph = drawn.model, drawn.p.graph
    load = frozen(graph.coherent_projection(data.draw(sets_of(model))))
    signal, edges = data.draw(sets_of(model)), set(map(tuple, np.argwhere(graph.edges)))
    closure = oracles.reach(edges, signal)
    found = frozen(graph.propagate(load, signal))
    assert found == (load | closure) - oracles.stars(closure)


@given(poc_sets(6), st.data())
def test_cor_projection_by_propagation(drawn: Drawn, data: st.DataObject) -> None:
    """[GK] cor:projection by propagation, for what the network computes.

    And lemma:propagation gives closest point projection. Read: for a *coherent*
    target ``T``; or propagate ``coh(T)``, which is right for every ``T``.
    """
    model, cubing, graph = drawn.model, drawn.cubing, drawn.p.graph
    state = frozen(graph.coherent_projection(data.draw(coherent_sets(model))))
    target = data.draw(sets_of(model))
    reduced = frozen(graph.coherent_projection(target))
    projected = model.projection(model.h(state), model.h(reduced))
    assert model.h(frozen(graph.propagate(state, reduced))) == projected
    assert listed(cubing.project(state, reduced)) == projected
    if model.coherent(target):
        assert model.h(frozen(graph.propagate(state, target))) == projected
    # As printed it forgets of the state what an incoherent target contradicts.
    assert model.h(frozen(graph.propagate(state, target))) >= projected


def test_cor_projection_by_propagation_fails_as_printed_for_incoherent_targets() -> (
    None
):
    graph = PocGraph.from_implications(2, [])
    cubing = Cubing(graph)
    assert not graph.coherent_projection([0, 1]).any()
    printed = graph.propagate([0], [0, 1])
    assert cubing.convex_set(printed).count() == 4
    assert cubing.project([0], []) == cubing.convex_set([0])


@given(poc_sets(5), st.data())
def test_what_is_no_vertex_is_refused_with_its_reason(
    drawn: Drawn, data: st.DataObject
) -> None:
    model, cubing = drawn.model, drawn.cubing
    chosen = data.draw(sets_of(model))
    if chosen in model.vertices:
        assert cubing.is_vertex(chosen)
        return
    assert not cubing.is_vertex(chosen)
    with pytest.raises(
        InvalidValueError, match=r"^u: must be (a \*-|complete|coherent)"
    ):
        cubing.minimal(chosen)
    if not model.coherent(chosen):
        with pytest.raises(InvalidValueError, match=r"^onto: must be coherent"):
            cubing.nearest(array(model.vertices[0], model.n), chosen)
        pair = drawn.p.clash(chosen)
        assert pair is not None
        a, b = map(drawn.p.sensorium.literal, pair)
        assert {a, b ^ 1} <= chosen
        assert (a, b) in model.order


@given(st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_counts_and_faces_of_larger_duals(sensors: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, 2 * sensors, (2 * sensors, 2))
    # Levels rise along every relation, so that nothing is contradicted.
    level = np.repeat(rng.integers(1, 9, sensors), 2)
    level[1::2] *= -1
    edges = [(int(a), int(b)) for a, b in pairs if level[a] < level[b]]
    cubing = Cubing(PocSet(sensors, edges))
    counts = cubing.face_vector()
    assert counts[0] == cubing.count()
    assert sum((-1) ** d * count for d, count in enumerate(counts)) == 1
    if counts[0] <= 2000:
        assert sum(1 for _ in cubing.vertices()) == counts[0]
        if sum(counts) <= 4000:
            found = [len(ways) for _, ways in cubing.cubes()]
            assert tuple(found.count(d) for d in range(len(counts))) == counts
