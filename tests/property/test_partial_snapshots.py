"""Snapshots equal counts kept pair by pair, whether readings are known or not."""

import itertools
from collections import Counter
from fractions import Fraction
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import Snapshot
from tests.support import oracles
from tests.support.edges import learned_edges, weights_of
from tests.support.strategies import Bits, as_set, bit_rows, observations, runs

Matrix: TypeAlias = NDArray[np.float64]
Reading: TypeAlias = tuple[list[bool], list[bool]]
"""The bits, and which of them are known."""
SHARES = st.floats(0.001, 0.25) | st.sampled_from([0.25, 1 / 8, 1 / 3 / 2, 0.01])
# With these and at most twelve observations doubles hold every weight exactly.
EXACT_SHARES = st.sampled_from([1 / 4, 1 / 8, 1 / 16])
EXACT_DECAYS = st.integers(0, 7).map(lambda k: k / 8)
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


@st.composite
def partial_runs(
    draw: st.DrawFn, most: int = 5, longest: int = 20
) -> tuple[int, list[Reading]]:
    """Draw a number of sensors and observations; of some not all may be known."""
    sensors = draw(st.integers(1, most))
    known = whole = st.just([True] * sensors)  # which is kept in another form
    if draw(st.booleans()):
        known = whole | bit_rows(sensors) | st.just([False] * sensors)
    seen = draw(observations(sensors, longest))
    return sensors, [(bits, draw(known)) for bits in seen]


def literals_of(reading: Reading) -> list[int]:
    return [
        2 * s + (not on)
        for s, (on, known) in enumerate(zip(*reading, strict=True))
        if known
    ]


def made(kind: type[Snapshot], run: tuple[int, list[Reading]], tau: float) -> Snapshot:
    snapshot = kind(run[0], tau)
    for bits, known in run[1]:
        snapshot.learn(bits, known)
    return snapshot


@given(partial_runs(), SHARES)
def test_an_empirical_snapshot_counts_each_pair_where_both_are_known(
    run: tuple[int, list[Reading]], tau: float
) -> None:
    sensors, seen = run
    n = 2 * sensors
    snapshot = EmpiricalSnapshot(sensors, tau)
    count: Counter[tuple[int, int]] = Counter()
    since = dict.fromkeys(itertools.permutations(range(sensors), 2), 0)
    before: oracles.Edges = set()
    for tick, reading in enumerate(seen, 1):
        twin = Snapshot.from_bytes(snapshot.to_bytes())
        state = snapshot.observe(*reading)
        count.update(itertools.permutations(literals_of(reading), 2))
        weights: oracles.Weights = {
            pair: count[pair] for pair in oracles.proper_pairs(n)
        }
        total = {
            (i, j): sum(count[2 * i + s, 2 * j + t] for s in (0, 1) for t in (0, 1))
            for i, j in since
        }
        limit = {(i, j): tau * total[i, j] for i, j in since}
        judged = {
            pair
            for pair, often in total.items()
            if often and (2 * often >= tick or limit[pair] >= 1)
        }
        strict = {
            (a, b)
            for a, b in oracles.implied(n, weights, lambda i, j: limit[i, j])  # noqa: B023
            if (a // 2, b // 2) in judged
        }
        both = {
            (a, b) for a, b in oracles.equal(n, weights) if (a // 2, b // 2) in judged
        }
        assert snapshot.clock == tick
        assert weights_of(snapshot) == weights
        assert learned_edges(snapshot, equivalences=False) == strict
        assert learned_edges(snapshot) == strict | both
        assert as_set(state) == oracles.projected(strict | both, literals_of(reading))
        since |= {(a // 2, b // 2): tick for a, b in before ^ (strict | both)}
        assert twin.learn(*reading) == (before != strict | both)
        before = strict | both
        assert learned_edges(twin) == before
        for a, b in oracles.proper_pairs(n):
            found = snapshot.evidence(a, b)
            assert found == twin.evidence(a, b)
            assert (found.both, found.against) == (weights[a, b], weights[a, b ^ 1])
            assert found.other == weights[a ^ 1, b]
            assert found.neither == weights[a ^ 1, b ^ 1]
            assert found.total == total[a // 2, b // 2]
            assert found.limit == limit[a // 2, b // 2]
            assert found.holds == ((a, b) in before)
            assert found.since == since[a // 2, b // 2]


@given(partial_runs(most=4, longest=12), EXACT_DECAYS, EXACT_SHARES)
def test_a_discounted_snapshot_discounts_each_pair_where_both_are_known(
    run: tuple[int, list[Reading]], decay: float, tau: float
) -> None:
    sensors, seen = run
    n = 2 * sensors
    snapshot = DiscountedSnapshot(sensors, tau, decay)
    weights: oracles.Weights = dict.fromkeys(oracles.proper_pairs(n), Fraction(1, 4))
    since = dict.fromkeys(weights, 0)
    before: oracles.Edges = set()
    for tick, (bits, known) in enumerate(seen, 1):
        state = snapshot.observe(bits, known)
        faded = oracles.discounted(n, weights, bits, Fraction(decay))
        for a, b in weights:
            if known[a // 2] and known[b // 2]:
                weights[a, b] = faded[a, b]
        strict = oracles.implied(n, weights, lambda *_: Fraction(tau))
        edges = strict | oracles.equal(n, weights)
        weights = oracles.truncated(weights, strict)
        assert oracles.implied(n, weights, lambda *_: Fraction(tau)) == strict
        assert weights_of(snapshot) == weights
        assert learned_edges(snapshot, equivalences=False) == strict
        assert learned_edges(snapshot) == edges
        start = literals_of((bits, known))
        assert as_set(state) == oracles.projected(edges, start)
        for a, b in before ^ edges:
            for pair in itertools.product((a, a ^ 1), (b, b ^ 1)):
                since[pair] = since[pair[::-1]] = tick
        before = edges
        for a, b in weights:
            found = snapshot.evidence(a, b)
            assert found.total == 1
            assert found.limit == tau
            assert (found.both, found.against) == (weights[a, b], weights[a, b ^ 1])
            assert found.holds == ((a, b) in edges)
            assert found.since == since[a, b]


def derived(w: Matrix, limit: Matrix) -> NDArray[np.bool_]:
    """The derived graph of weights on all pairs of literals; all is exact."""
    swap = np.arange(len(w)) ^ 1
    against, other, neither = w[:, swap], w[swap], w[swap][:, swap]
    least = np.minimum(np.minimum(w, limit), np.minimum(other, neither))
    edges = (against < least) | ((against == 0) & (other == 0) & (w + neither > 0))
    edges[np.arange(len(w)) // 2 == np.arange(len(w))[:, None] // 2] = False
    return np.asarray(edges, np.bool_)


def truncated(w: Matrix, edges: NDArray[np.bool_]) -> Matrix:
    """Each weight against an implication moved, once with its contrapositive."""
    w = w.copy()
    for a, b in np.argwhere(edges & ~edges.T):
        if a < b ^ 1:
            against = w[a, b ^ 1]
            for s, t, sign in [(0, 1, -1), (0, 0, 1), (1, 1, 1), (1, 0, -1)]:
                w[a ^ s, b ^ t] += sign * against
                w[b ^ t, a ^ s] += sign * against
    return w


@given(
    st.integers(7, 75),
    st.integers(1, 12),
    st.sampled_from([0.9, 1.0]),
    EXACT_SHARES,
    st.integers(0, 2**32),
)
def test_vectors_do_not_show_in_larger_snapshots(
    sensors: int, ticks: int, read: float, tau: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    share = np.full((2 * sensors, 2 * sensors), tau)
    counts = EmpiricalSnapshot(sensors, tau)
    weighted = DiscountedSnapshot(sensors, tau, 7 / 8)
    n, total = np.zeros((2, 2 * sensors, 2 * sensors))
    clock = 0
    w = np.full((2 * sensors, 2 * sensors), 0.25)
    levels = rng.integers(0, 6, sensors)
    for _ in range(ticks):
        bits = (levels < rng.integers(0, 7)) ^ (rng.random(sensors) < 0.1)
        known = rng.random(sensors) < read
        on = (np.stack([bits, ~bits], 1) & known[:, None]).ravel().astype(float)
        both = np.outer(known, known).repeat(2, 0).repeat(2, 1)
        counts.learn(bits, known)
        weighted.learn(bits, known)
        n, total, clock = n + np.outer(on, on), total + both, clock + 1
        judged = (2 * total >= clock) | (share * total >= 1)
        w = np.where(both, 7 / 8 * w + 1 / 8 * np.outer(on, on), w)
        counted = derived(n, share * total) & judged
        assert (counts.poc_graph().edges == counted).all()
        edges = derived(w, share)
        assert (weighted.poc_graph().edges == edges).all()
        w = truncated(w, edges)


@KINDS
@given(run=partial_runs(), tau=SHARES)
def test_full_observations_come_to_the_same_in_either_form(
    kind: type[Snapshot], run: tuple[int, list[Reading]], tau: float
) -> None:
    sensors, seen = run
    nothing = ([False] * sensors, [False] * sensors)
    full = [(bits, [True] * sensors) for bits, _ in seen]
    narrow = made(kind, (sensors, full), tau)
    wide = made(kind, (sensors, [nothing, *full]), tau)
    assert wide.clock == narrow.clock + 1
    weights, then = weights_of(wide), (weights_of(narrow), learned_edges(narrow))
    assert weights == pytest.approx(then[0], rel=0, abs=1e-14)
    if kind is EmpiricalSnapshot:
        assert (weights, learned_edges(wide)) == then
    narrow.learn(*nothing)  # one of two, at most, so that every pair is still judged
    assert (weights_of(narrow), learned_edges(narrow)) == then


@KINDS
@given(
    first=partial_runs(), second=partial_runs(most=1), tau=SHARES, whole=st.booleans()
)
def test_a_saved_snapshot_goes_on_as_if_nothing_had_happened(
    kind: type[Snapshot],
    first: tuple[int, list[Reading]],
    second: tuple[int, list[Reading]],
    tau: float,
    whole: bool,
) -> None:
    if whole:  # what it stores then is less
        first = first[0], [(bits, [True] * first[0]) for bits, _ in first[1]]
    snapshot = made(kind, first, tau)
    twin = kind.from_bytes(snapshot.to_bytes())
    assert twin.to_bytes() == snapshot.to_bytes()
    for on, known in second[1]:
        reading = (on * first[0], known * first[0])
        assert (twin.observe(*reading) == snapshot.observe(*reading)).all()
    assert twin.to_bytes() == snapshot.to_bytes()


@given(partial_runs(), SHARES, st.data())
def test_sensors_always_known_together_have_the_edges_of_their_own_snapshot(
    run: tuple[int, list[Reading]], tau: float, data: st.DataObject
) -> None:
    sensors, seen = run
    group = sorted(data.draw(st.sets(st.integers(0, sensors - 1), min_size=1)))
    alone = EmpiricalSnapshot(len(group), tau)
    snapshot = EmpiricalSnapshot(sensors, tau)
    for bits, known in seen:
        together = known[group[0]]
        snapshot.learn(
            bits, [together if s in group else k for s, k in enumerate(known)]
        )
        alone.learn([bits[s] for s in group], [together] * len(group))
    within = [2 * s + sign for s in group for sign in (0, 1)]
    edges = snapshot.poc_graph().edges[np.ix_(within, within)]
    assert (edges == alone.poc_graph().edges).all()
    strict = learned_edges(snapshot, equivalences=False)
    assert not oracles.has_cycle({edge for edge in strict if {*edge} <= {*within}})


SLACK = Fraction(1e-12)


@pytest.mark.parametrize(("tau", "decay"), [(0.02, 0.9), (1 / 8000, 63 / 64)])
@pytest.mark.slow
def test_a_long_discounted_walk_keeps_to_exact_arithmetic(
    tau: float, decay: float
) -> None:
    sensors, n = 5, 10
    snapshot = DiscountedSnapshot(sensors, tau, decay)
    weights: oracles.Weights = dict.fromkeys(oracles.proper_pairs(n), Fraction(1, 4))
    place, rng = 0, np.random.default_rng(7)
    learned = 0
    for _ in range(650):
        place = min(max(place + int(rng.integers(-1, 2)), 0), sensors)
        bits = [place > s for s in range(sensors)]
        learned += snapshot.learn(bits)
        weights = oracles.discounted(n, weights, bits, Fraction(decay))
        strict = oracles.implied(n, weights, lambda _i, _j: Fraction(tau), SLACK)
        both = oracles.equal(n, weights, SLACK)
        assert learned_edges(snapshot) == strict | both
        # Fractions would grow without end; 200 bits are far below what doubles see.
        weights = {
            pair: Fraction(int(w * 2**200), 2**200)
            for pair, w in oracles.truncated(weights, strict).items()
        }
    assert learned >= 1
    for pair, weight in weights_of(snapshot).items():
        assert weight == pytest.approx(float(weights[pair]), abs=1e-13)


@given(st.integers(1, 80), st.floats(0.5, 0.999), st.booleans(), st.data())
def test_a_tie_becomes_no_implication(
    ticks: int, decay: float, opposite: bool, data: st.DataObject
) -> None:
    snapshot = DiscountedSnapshot(2, 0.25, decay)
    alike = {(0, 2), (2, 0), (1, 3), (3, 1)}
    unlike = {(0, 3), (3, 0), (1, 2), (2, 1)}
    for _ in range(ticks):
        bit = data.draw(st.booleans())
        snapshot.learn([bit, bit != opposite])
        assert learned_edges(snapshot, equivalences=False) == set()
        assert learned_edges(snapshot) in (set(), unlike if opposite else alike)


@given(runs(longest=30), st.booleans(), SHARES, st.sampled_from([0.5, 0.9]))
def test_a_derived_graph_is_acyclic_between_its_classes(
    run: tuple[int, Bits], counts: bool, tau: float, decay: float
) -> None:
    sensors, seen = run
    snapshot: Snapshot = EmpiricalSnapshot(sensors, tau)
    if not counts:
        snapshot = DiscountedSnapshot(sensors, tau, decay)
    for bits in seen:
        snapshot.learn(bits)
    strict = learned_edges(snapshot, equivalences=False)
    both = learned_edges(snapshot) - strict
    head = {a: min(oracles.reach(both, [a])) for a in range(2 * sensors)}
    assert not oracles.has_cycle(strict)
    assert not oracles.has_cycle({(head[a], head[b]) for a, b in strict})
    assert all(head[a] != head[a ^ 1] for a in range(2 * sensors))
    assert all(snapshot.poc_graph().representative[a] == head[a] for a in head)


@given(runs(most=3, longest=4), st.booleans(), st.data())
def test_damaged_bytes_are_refused_or_mean_the_same(
    run: tuple[int, Bits], counts: bool, data: st.DataObject
) -> None:
    sensors, seen = run
    kind = EmpiricalSnapshot if counts else DiscountedSnapshot
    snapshot: Snapshot = kind(sensors)
    for bits in seen:
        snapshot.observe(bits)
    whole = snapshot.to_bytes()
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, len(whole) - 1))] = data.draw(
            st.integers(0, 255)
        )
    damaged = damaged[: data.draw(st.sampled_from([len(whole), len(whole) // 2]))]
    try:
        twin = Snapshot.from_bytes(bytes(damaged))
    except InvalidValueError:
        return
    assert twin.to_bytes() == whole
