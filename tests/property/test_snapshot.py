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
from tests.support.strategies import Bits, runs

SHARES = st.floats(0.001, 0.25) | st.sampled_from([0.25, 1 / 8, 1 / 3 / 2, 0.01])
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
