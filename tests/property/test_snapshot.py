"""Snapshots match a reference implementation on random observations."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import Snapshot
from tests.support import oracles
from tests.support.edges import learned_edges, weights_of
from tests.support.strategies import Bits, as_set, runs

SHARES = st.floats(0.001, 0.25) | st.sampled_from([0.25, 1 / 8, 1 / 3 / 2, 0.01])
# With these and at most twelve observations every weight is a whole number of
# 4 * 8**12ths: doubles hold it exactly, and nothing but a tie is within 1e-12.
EXACT_SHARES = st.sampled_from([1 / 4, 1 / 8, 1 / 16])
EXACT_DECAYS = st.integers(0, 7).map(lambda k: k / 8)
SLACK = Fraction(1e-12)


@given(runs(), SHARES)
def test_an_empirical_snapshot_is_what_its_observations_say(
    run: tuple[int, Bits], tau: float
) -> None:
    sensors, seen = run
    n = 2 * sensors
    snapshot = EmpiricalSnapshot(sensors, tau)
    for tick, bits in enumerate(seen, 1):
        before, twin = learned_edges(snapshot), Snapshot.from_bytes(snapshot.to_bytes())
        state = snapshot.observe(bits)
        weights = oracles.counted(n, seen[:tick])
        strict = oracles.implied(n, weights, lambda *_: tau * tick)  # noqa: B023
        both = oracles.equal(n, weights)
        assert snapshot.clock == tick
        assert weights_of(snapshot) == weights
        assert learned_edges(snapshot, equivalences=False) == strict
        assert learned_edges(snapshot) == strict | both
        start = {a for a in range(n) if oracles.holds(bits, a)}
        assert as_set(state) == oracles.projected(strict | both, start)
        assert as_set(snapshot.state) == as_set(state)
        assert twin.learn(bits) == (before != strict | both)
        assert learned_edges(twin) == strict | both


@given(runs(most=4, longest=12), EXACT_DECAYS, EXACT_SHARES)
def test_a_discounted_snapshot_is_what_its_definition_says(
    run: tuple[int, Bits], decay: float, tau: float
) -> None:
    sensors, seen = run
    n = 2 * sensors
    snapshot = DiscountedSnapshot(sensors, tau, decay)
    weights: oracles.Weights = dict.fromkeys(oracles.proper_pairs(n), Fraction(1, 4))
    for bits in seen:
        before = learned_edges(snapshot)
        assert snapshot.learn(bits) == (before != learned_edges(snapshot))
        weights = oracles.discounted(n, weights, bits, Fraction(decay))
        strict = oracles.implied(n, weights, lambda *_: Fraction(tau))
        both = oracles.equal(n, weights)
        weights = oracles.truncated(weights, strict)
        assert weights_of(snapshot) == weights
        assert learned_edges(snapshot, equivalences=False) == strict
        assert learned_edges(snapshot) == strict | both


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


@given(runs(longest=40), st.sampled_from([0.3, 0.5, 0.9, 63 / 64]), SHARES)
def test_truncation_leaves_the_derived_graph(
    run: tuple[int, Bits], decay: float, tau: float
) -> None:
    sensors, seen = run
    n = 2 * sensors
    snapshot = DiscountedSnapshot(sensors, tau, decay)
    for bits in seen:
        snapshot.learn(bits)
        weights = weights_of(snapshot)
        for pair in oracles.proper_pairs(n):
            assert weights[pair] >= -1e-15
        strict = learned_edges(snapshot, equivalences=False)
        for a, b in strict:
            assert abs(weights[a, b ^ 1]) < 1e-15
            assert weights[a ^ 1, b] > 0.99e-12
        again = oracles.implied(n, dict(weights), lambda _i, _j: tau, 1e-12)
        assert again == strict


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
