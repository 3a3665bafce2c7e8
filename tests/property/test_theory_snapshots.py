"""The paper's statements on snapshots, tested on random input."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.morphism import canonical_projection
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.order.pocset import PocSet
from tests.support import oracles
from tests.support.hypothesis_settings import examples
from tests.support.oracles import Number, Weights
from tests.support.strategies import Bits, as_set, runs
from tests.support.theory_oracles import Model


def marginal(w: Weights, a: int, b: int) -> Number:
    return w[a, b] + w[a, b ^ 1]


def orientation(w: Weights, a: int, b: int) -> Number:
    """[GK] eqn:orientation cocycle."""
    return w[a ^ 1, b] - w[a, b ^ 1]


def dissimilarity(w: Weights, a: int, b: int) -> Number:
    """[GK] proofs:adding equivalences; its inequality reads ``ac <= ab + bc``."""
    return w[a ^ 1, b] + w[a, b ^ 1]


def check_probabilistic(n: int, w: Weights, total: Number) -> None:
    """[GK] defn:probabilistic snapshot, with weights that add up to `total`.

    Its orientation constraint follows from its consistency constraint.
    """
    for a, b in oracles.proper_pairs(n):
        assert w[a, b] >= 0
        assert w[a, b] == w[b, a]
        assert marginal(w, a, b) + marginal(w, a ^ 1, b) == total
        for c in range(n):
            if c // 2 not in (a // 2, b // 2):
                assert marginal(w, a, b) == marginal(w, a, c)
                around = orientation(w, a, b) + orientation(w, b, c)
                assert around == orientation(w, a, c)


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.tuples(
            st.just(n),
            st.lists(
                st.tuples(st.integers(0, 2 * n - 1), st.integers(0, 2 * n - 1)),
                max_size=6,
            ),
        )
    )
)
def test_lemma_derived_poc_set(relation: tuple[int, list[tuple[int, int]]]) -> None:
    """[GK] lemma:derived poc set: a weak poc set iff there is no directed cycle."""
    sensors, pairs = relation
    edges = set(pairs) | {(b ^ 1, a ^ 1) for a, b in pairs}
    strict = [(a, "<", b) for a, b in pairs]
    if oracles.has_cycle(edges):
        with pytest.raises(InvalidValueError, match=r"^relations: must (have|not)"):
            PocSet(sensors, strict)
    else:
        p = PocSet(sensors, strict)
        assert not p.graph.classes()
        for a, b in itertools.product(range(2 * sensors), repeat=2):
            assert a == b or not p.equal(a, b)


@given(runs(most=4, longest=12), st.sampled_from([0.0, 1 / 2, 7 / 8]))
def test_what_discounts_is_a_probabilistic_snapshot(
    run: tuple[int, Bits], decay: float
) -> None:
    """[GK] defn:probabilistic snapshot, lemma:discounted update; also truncated.

    With these decays doubles are exact for so few observations.
    """
    n, snapshot = 2 * run[0], DiscountedSnapshot(run[0], 1 / 4, decay)
    for bits in run[1]:
        state = as_set(snapshot.observe(bits))
        w: Weights = {(a, b): snapshot.weight(a, b) for a, b in oracles.proper_pairs(n)}
        check_probabilistic(n, w, 1)
        assert not state & oracles.stars(state)
        assert snapshot.poc_graph().is_coherent(state)


@given(runs(most=4, longest=12))
def test_lemma_empirical_evolves_from_trivial_an_evolution_is_empirical(
    run: tuple[int, Bits],
) -> None:
    """[GK] defn:empirical snapshot, of the trivial one and of all that it becomes."""
    n, snapshot = 2 * run[0], EmpiricalSnapshot(run[0], 1 / 4)
    for tick, bits in enumerate([None, *run[1]]):
        if bits is not None:
            snapshot.observe(bits)
        state = as_set(snapshot.state)
        w: Weights = {(a, b): snapshot.weight(a, b) for a, b in oracles.proper_pairs(n)}
        check_probabilistic(n, w, tick)
        assert snapshot.poc_graph().is_coherent(state)
        for a, b in w:
            assert w[a, b] == int(w[a, b])
            assert marginal(w, a, b) > 0 or a not in state


def test_lemma_empirical_evolves_from_trivial_fails_as_printed() -> None:
    """[GK] lemma:empirical evolves from trivial; read: an evolution is empirical.

    The converse fails: three sensors pairwise opposed in both of two observations
    make an empirical snapshot by definition, and no two observations do that.
    """
    w: Weights = {(a, b): int(a % 2 != b % 2) for a, b in oracles.proper_pairs(6)}
    check_probabilistic(6, w, 2)
    everything = list(itertools.product([False, True], repeat=3))
    for seen in itertools.product(everything, repeat=2):
        assert oracles.counted(6, [list(bits) for bits in seen]) != w


@examples(60)
@given(runs(most=5, longest=14), st.sampled_from([0.25, 0.1, 0.02]), st.data())
def test_prop_adding_equivalences(
    run: tuple[int, Bits], tau: float, data: st.DataObject
) -> None:
    """[GK] prop:adding equivalences, points 1 to 4, and the lemmas before it.

    Point 3 reads: a fibre's *proper* elements cross. Elements of a fibre are never
    below each other, but negligible ones are below each other's complements.
    """
    sensors, seen = run
    n, snapshot = 2 * sensors, EmpiricalSnapshot(sensors, tau)
    for bits in seen:
        snapshot.learn(bits)
    w = oracles.counted(n, seen)
    strict = oracles.implied(n, w, lambda _i, _j: tau * len(seen))
    both = oracles.equal(n, w) if seen else set()
    fibre = {a: frozenset(oracles.reach(both, [a])) for a in range(n)}
    fine = Model(n, strict)
    for a in range(n):
        assert fibre[a ^ 1] == oracles.stars(fibre[a])
        assert fibre[a ^ 1] != fibre[a]
        for b in range(n):
            if a // 2 != b // 2 and b in fibre[a]:
                assert dissimilarity(w, a, b) == 0
            if a != b and (a, b) in fine.order:
                assert not fibre[a] & fibre[b]
        for b, c in itertools.permutations(range(0, n, 2), 2):
            if a // 2 not in (b // 2, c // 2):
                direct = dissimilarity(w, b, c)
                assert direct <= dissimilarity(w, b, a) + dissimilarity(w, a, c)
    coarse = {(fibre[a], fibre[b]) for a, b in strict}
    blocks = {block: k for k, block in enumerate(set(fibre.values()))}
    assert not oracles.has_cycle({(blocks[x], blocks[y]) for x, y in coarse})
    for a, b in itertools.permutations(range(n), 2):
        if b in fibre[a] and fine.proper(a) and fine.proper(b):
            assert fine.crosses(a, b)
    chosen = data.draw(st.sets(st.integers(0, n - 1)))
    reached = oracles.reach(
        {(blocks[x], blocks[y]) for x, y in coarse}, {blocks[fibre[a]] for a in chosen}
    )
    above = {a for a in range(n) if blocks[fibre[a]] in reached}
    assert as_set(snapshot.poc_graph().up(chosen)) == above


def test_prop_adding_equivalences_point_3_fails_as_printed() -> None:
    """Equal ``a`` and ``b`` that lead to ``a*``: their fibre is not transverse."""
    seen = (
        [[True, True, True, False]] * 2
        + [[True, True, False, True]]
        + [[False, False, True, True]] * 10
        + [[False, False, False, True]] * 10
        + [[False, False, False, False]] * 10
    )
    w = oracles.counted(8, seen)
    assert (0, 2) in oracles.equal(8, w)
    fine = Model(8, oracles.implied(8, w, lambda _i, _j: 0.25 * len(seen)))
    assert (0, 3) in fine.order
    assert fine.negligible(0)
    snapshot = EmpiricalSnapshot(4, 0.25)
    for bits in seen:
        snapshot.observe(bits)
    p = PocSet.from_graph(snapshot.poc_graph())
    assert p.negligible[[0, 2]].all()
    assert canonical_projection(p).target.sensorium.names == ("s2", "s3")


def test_truncated_discounted_snapshots_break_the_triangle_inequality() -> None:
    """[GK] after eqn:triangle inequality for snapshots: discounted ones are to keep it.

    Without truncation they do, as sums of indicators; truncation moves weight.
    """
    snapshot = DiscountedSnapshot(3, 0.25, 0.5)
    for bits in ([0, 0, 1], [0, 1, 1], [0, 1, 0], [1, 0, 0], [1, 0, 1]):
        snapshot.observe(bits)
    pairs = oracles.proper_pairs(6)
    w: Weights = {(a, b): snapshot.weight(a, b) for a, b in pairs}
    whole = dissimilarity(w, 0, 2)
    assert float(whole) > float(dissimilarity(w, 0, 4) + dissimilarity(w, 4, 2)) + 0.4
