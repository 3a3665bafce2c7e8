"""Contradictions and covers equal those found by brute force; many are counted."""

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from neurosnap.poc.order.contradiction import (
    CHAINS,
    PATIENCE,
    Cover,
    conflicts,
    contradiction,
    smallest_cover,
)
from neurosnap.poc.order.graph import PocGraph
from tests.support.edges import edges_of
from tests.support.oracles import Edges, below_or_equal, coherent
from tests.support.strategies import graphs


@st.composite
def readings(draw: st.DrawFn) -> tuple[PocGraph, list[int], list[float]]:
    """Draw a graph, what was read of some of its sensors, and a suspicion."""
    graph = draw(graphs(most=7))
    values = st.sampled_from([None, 0, 1])
    read = draw(st.lists(values, min_size=graph.sensors, max_size=graph.sensors))
    # Whole numbers: sums are exact, whichever comes first.
    doubts = st.lists(
        st.integers(-2, 2).map(float), min_size=graph.sensors, max_size=graph.sensors
    )
    seen = [2 * s + bit for s, bit in enumerate(read) if bit is not None]
    return graph, seen, draw(doubts)


def order_of(graph: PocGraph) -> Edges:
    return below_or_equal(len(graph), edges_of(graph.edges))


def smallest(order: Edges, seen: list[int]) -> list[tuple[int, ...]]:
    """Return all smallest sets of sensors without which a reading is coherent."""
    sensors = [a // 2 for a in seen]
    for size in range(len(seen) + 1):
        found = [
            chosen
            for chosen in combinations(sensors, size)
            if coherent(order, {a for a in seen if a // 2 not in chosen})
        ]
        if found:
            return found
    raise AssertionError("without any sensor it is coherent")


def broken_in(order: Edges, seen: list[int]) -> set[tuple[int, int]]:
    """Return the implications that a reading breaks; of contrapositives one."""
    pairs = [(a, b ^ 1) for a in seen for b in seen if (a, b ^ 1) in order]
    return {min((a, c), (c ^ 1, a ^ 1)) for a, c in pairs}


@given(readings())
def test_culprits_are_the_smallest_set_by_the_rule(
    drawn: tuple[PocGraph, list[int], list[float]],
) -> None:
    graph, seen, doubts = drawn
    sets = smallest(order_of(graph), seen)
    found = contradiction(graph, seen, np.array(doubts).__getitem__)
    assert found.exact
    assert found.coherent == graph.is_coherent(seen)
    best = min(sets, key=lambda chosen: (-sum(doubts[s] for s in chosen), chosen))
    for named, wanted in (
        (found.culprits, best),
        (found.candidates, {s for chosen in sets for s in chosen}),
    ):
        assert named == tuple(sorted(wanted, key=lambda s: (-doubts[s], s)))


@given(readings())
def test_chains_explain_whatever_is_broken(
    drawn: tuple[PocGraph, list[int], list[float]],
) -> None:
    graph, seen, _ = drawn
    wires, known = edges_of(graph.hasse()), {a // 2 for a in seen}
    inner = {(a, b) for a, b in wires if b // 2 not in known}
    found = contradiction(graph, seen, np.zeros_like)
    broken = broken_in(order_of(graph), seen)
    assert found.more == 0
    explained = {}
    for chain in found.chains:
        assert all(link in wires for link in pairwise(chain))
        assert all(a // 2 not in known for a in chain[1:-1])
        assert (chain[0], chain[-1]) in broken
        explained[chain[0], chain[-1]] = len(chain)
    assert len(explained) == len(found.chains)
    assert bool(explained) == bool(broken)
    # Walks by their length: through sensors that were not read, then one hop more.
    for a in seen:
        ring, reached, length = {a}, {a}, 1
        shortest: dict[int, int] = {}
        while ring:
            length += 1
            for _, c in ((x, c) for x, c in wires if x in ring and c ^ 1 in seen):
                shortest.setdefault(c, length)
            ring = {c for x, c in inner if x in ring} - reached
            reached |= ring
        for c, least in shortest.items():
            assert explained[min((a, c), (c ^ 1, a ^ 1))] == least


@given(readings(), st.integers(0, 12))
def test_without_patience_culprits_still_help_and_none_is_spare(
    drawn: tuple[PocGraph, list[int], list[float]], patience: int
) -> None:
    graph, seen, doubts = drawn
    order = order_of(graph)
    found = contradiction(graph, seen, np.array(doubts).__getitem__, patience=patience)
    best = contradiction(graph, seen, np.array(doubts).__getitem__)
    left = {a for a in seen if a // 2 not in found.culprits}
    assert coherent(order, left)
    assert len(found.culprits) >= len(best.culprits)
    assert set(found.candidates) >= set(best.candidates)
    for spared in found.culprits:
        again = left | {a for a in seen if a // 2 == spared}
        assert not coherent(order, again)
    if found.exact:
        assert found == best


def cover_of(
    neighbours: Mapping[int, int],
    worth: Sequence[float],
    patience: int = PATIENCE,
) -> Cover:
    masks = [neighbours.get(v, 0) for v in range(len(worth))]
    return smallest_cover(masks, np.array(worth), np.ones(len(worth), int), patience)


@given(st.integers(2, 9), st.floats(0.2, 0.9), st.integers(0, 2**32 - 1))
def test_a_vertex_that_counts_for_several_is_as_if_they_were_there(
    count: int, density: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    graph, sizes = nx.gnp_random_graph(count, density, seed), rng.integers(1, 4, count)
    worth = rng.integers(0, 3, count)
    masks = [sum(1 << u for u in graph[v]) for v in range(count)]
    of = np.repeat(range(count), sizes).tolist()
    every = [sum(1 << k for k, u in enumerate(of) if masks[v] >> u & 1) for v in of]
    ones = np.ones(len(of), int)
    each = smallest_cover(every, worth[of].astype(float), ones, 10**6)
    found = smallest_cover(masks, (worth * sizes).astype(float), sizes, 10**6)
    for some, single in (
        (found.chosen, each.chosen),
        (found.candidates, each.candidates),
    ):
        assert sum(1 << k for k, v in enumerate(of) if some >> v & 1) == single


@given(st.integers(2, 24), st.floats(0.05, 0.6), st.integers(0, 2**32 - 1))
def test_a_cover_is_as_small_as_a_clique_of_the_complement_is_large(
    count: int, density: float, seed: int
) -> None:
    graph = nx.gnp_random_graph(count, density, seed)
    assume(graph.number_of_edges())
    clique, size = nx.max_weight_clique(nx.complement(graph), weight=None)
    around = {v: sum(1 << u for u in graph[v]) for v in graph if graph[v]}
    cover = cover_of(around, [0.0] * count, patience=10**6)
    assert cover.exact
    assert cover.chosen.bit_count() == count - size == count - len(clique)
    assert all(cover.chosen >> u & 1 or cover.chosen >> v & 1 for u, v in graph.edges)


def test_what_counts_for_several_is_taken_greedily_as_a_whole() -> None:
    star = [0b1110, 1, 1, 1]
    found = smallest_cover(star, np.zeros(4), np.array([2, 1, 1, 1]), patience=0)
    assert found == (1, 1, True)


def test_what_is_forced_leaves_fewer_to_suffice_for_the_rest() -> None:
    # Of three that suffice the first meets four, the next three, the last two.
    graph = nx.Graph([(0, 3), (0, 4), (0, 5), (0, 6), (1, 6), (1, 7), (1, 8)])
    graph.add_edges_from([(2, 8), (2, 9)])
    around = {v: sum(1 << u for u in graph[v]) for v in graph}
    assert cover_of(around, [0.0] * 10, patience=0) == (0b111, 0b111, True)


def test_cliques_stars_and_chains_take_no_recursion() -> None:
    count = 300
    every = (1 << count) - 1
    clique = {v: every & ~(1 << v) for v in range(count)}
    assert cover_of(clique, [0.0] * count, 10**6) == (every >> 1, every, True)
    star = {0: every & ~1} | dict.fromkeys(range(1, count), 1)
    assert cover_of(star, [0.0] * count) == (1, 1, True)
    # Of two chains that cross the wrong way, each step breaks with all beyond it.
    nested = {v: sum(1 << u for u in range(150, 300 - v)) for v in range(150)}
    nested |= {u: sum(1 << v for v in range(300 - u)) for u in range(150, 300)}
    found = cover_of(nested, [0.0] * count, patience=10**6)
    assert found.exact
    assert found.chosen.bit_count() == 150


def test_what_is_taken_greedily_and_proves_spare_is_given_up() -> None:
    spider = {0: 0b1110, 1: 0b10001, 2: 0b100001, 3: 0b1000001}
    spider |= {4: 0b10, 5: 0b100, 6: 0b1000}
    found = cover_of(spider, [0.0] * 7, patience=0)
    assert found == (0b1110, 0b1111111, False)


def test_a_search_that_is_too_long_says_so() -> None:
    graph = nx.random_regular_graph(5, 120, seed=1)
    around = {v: sum(1 << u for u in graph[v]) for v in graph}
    found = cover_of(around, [0.0] * 120)
    assert not found.exact
    assert all(found.chosen >> u & 1 or found.chosen >> v & 1 for u, v in graph.edges)
    assert found.candidates == (1 << 120) - 1


def test_a_few_that_clash_with_many_are_found_without_a_search() -> None:
    """Three centers of stars that share leaves: patience for no vertex at all."""
    count, centers = 400, (3, 200, 399)
    around: dict[int, int] = dict.fromkeys(range(count), 0)
    for number, center in enumerate(centers):
        for leaf in set(range(number, count, 2)) - set(centers):
            around[center] |= 1 << leaf
            around[leaf] |= 1 << center
    found = cover_of(around, [0.0] * count, patience=0)
    chosen = sum(1 << center for center in centers)
    assert found == (chosen, chosen, True)


def test_patience_is_for_all_parts_together() -> None:
    """Rings of five, far from each other: there is enough for some of them."""
    rings, around = 40, {}
    for ring in range(rings):
        for v in range(5):
            here = 5 * ring + v
            around[here] = 1 << 5 * ring + (v + 1) % 5 | 1 << 5 * ring + (v + 4) % 5
    some = cover_of(around, [0.0] * 5 * rings, patience=300)
    assert not some.exact
    assert some.chosen.bit_count() == 3 * rings
    assert cover_of(around, [0.0] * 5 * rings, patience=2_000).exact


def bipartite(wide: int) -> tuple[PocGraph, list[int], set[tuple[int, int]]]:
    """Return an order, a reading that breaks each implication in it, and those."""
    lows, highs = range(0, 2 * wide, 2), range(2 * wide, 4 * wide, 2)
    pairs = [(a, b) for a in lows for b in highs]
    order = PocGraph.from_implications(2 * wide, pairs)
    return order, [*lows, *(b + 1 for b in highs)], set(pairs)


def test_many_broken_implications_are_counted_and_not_all_listed() -> None:
    order, seen, pairs = bipartite(20)
    assert set(contradiction(order, seen, np.zeros_like).chains) == pairs
    wide = CHAINS // 20
    assert wide > 40
    order, seen, _ = bipartite(wide)
    found = contradiction(order, seen, np.zeros_like)
    assert (len(found.chains), found.more) == (CHAINS, wide * wide - CHAINS)
    assert len(found.culprits) == wide


def test_conflicts_are_found_among_many_literals() -> None:
    # Sensors below 5 rule out all that follow; others are in conflict with few.
    many = 700
    broken = [(2 * a, 2 * b + 1) for a in range(5) for b in range(5, many)]
    broken += [(2 * a, 2 * a + 3) for a in range(5, many - 1, 7)]
    graph = PocGraph.from_implications(many, broken)
    clashing = 2 * np.arange(many)
    wanted = [0] * many
    for a, b in broken:
        wanted[a >> 1] |= 1 << (b >> 1)
        wanted[b >> 1] |= 1 << (a >> 1)
    assert conflicts(graph, clashing) == wanted
