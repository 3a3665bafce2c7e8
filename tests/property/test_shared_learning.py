"""Snapshots that divide the pairs of sensors equal one snapshot of all pairs."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.protocol.learn_control import pairs_in
from neurosnap.protocol.worker_learning import pieces_of

KINDS = ("fixed", "auto", "discounted")


def new(kind: str, sensors: int, share: range | None) -> Snapshot:
    if kind == "auto":
        return EmpiricalSnapshot(sensors, "auto", share)
    if kind == "discounted":
        return DiscountedSnapshot(sensors, 0.05, 0.9, share)
    return EmpiricalSnapshot(sensors, 0.1, share)


def readings(
    seed: int, sensors: int, unknown: bool
) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Sensors that stay for a while, some copies of others, some never known."""
    rng = np.random.default_rng(seed)
    bits, some = rng.integers(0, 2, sensors), []
    for tick in range(rng.integers(50, 100)):
        bits = np.where(rng.random(sensors) < 0.2, rng.integers(0, 2, sensors), bits)
        bits[1::3] = bits[: len(bits[1::3])]
        lacks = unknown and tick > 40
        some.append((bits.copy(), rng.random(sensors) < 0.8 if lacks else None))
    return some


@pytest.mark.parametrize("kind", KINDS)
@given(
    seed=st.integers(0, 2**32 - 1),
    sensors=st.integers(1, 24),
    cuts=st.lists(st.integers(0, 24), max_size=3),
    unknown=st.booleans(),
)
def test_shares_are_what_one_snapshot_is(
    kind: str, seed: int, sensors: int, cuts: list[int], unknown: bool
) -> None:
    inner = sorted(min(cut, sensors) for cut in cuts)
    shares = [range(*ends) for ends in pairwise([0, *inner, sensors])]
    whole = new(kind, sensors, None)
    parts = [new(kind, sensors, share) for share in shares]
    order = new(kind, sensors, range(0))
    for bits, known in readings(seed, sensors, unknown):
        changed = whole.learn(bits, known)
        order.learn(bits, known)
        told = [follow(order, part, bits, known) for part in parts]
        assert any(told) == changed
        np.testing.assert_array_equal(whole.poc_graph().edges, order.poc_graph().edges)
    assert_same_arrays(whole, parts, order)
    again = [
        type(part).from_arrays(part.arrays(), share)
        for part, share in zip(parts, shares, strict=True)
    ]
    for bits, known in readings(seed + 1, sensors, unknown):
        for each in (whole, order, *again):
            each.learn(bits, known)
    assert_same_arrays(whole, again, order)


def follow(
    order: Snapshot, part: Snapshot, bits: np.ndarray, known: np.ndarray | None
) -> bool:
    """Let a share learn, and the order follow what it says changed."""
    part.learn(bits, known)
    pieces = pieces_of(0, part.clock, part.changes(), most=8)
    told = [order.relate(*pairs_in(piece, part.share)) for piece in pieces]
    return any(told)


def assert_same_arrays(whole: Snapshot, parts: list[Snapshot], order: Snapshot) -> None:
    """Pairs are where they belong; all else is everywhere."""
    expected, found = whole.arrays(), [part.arrays() for part in parts]
    for name, array in expected.items():
        if name in OF_PAIRS:
            pieces = np.concatenate([one[name] for one in found], axis=-1)
            np.testing.assert_array_equal(pieces, array)
            assert order.arrays()[name].shape == (*array.shape[:-1], 0)
        elif name != "state":
            for one in (*found, order.arrays()):
                np.testing.assert_array_equal(one[name], array)


@given(st.integers(0, 2**32 - 1), st.sampled_from(KINDS), st.booleans())
def test_a_share_has_the_evidence_of_its_pairs(
    seed: int, kind: str, unknown: bool
) -> None:
    whole, part = new(kind, 9, None), new(kind, 9, range(4, 7))
    for bits, known in readings(seed, 9, unknown):
        whole.learn(bits, known)
        part.learn(bits, known)
    for a in range(8, 14):
        for b in range(2 * (a // 2)):
            assert part.evidence(a, b) == whole.evidence(a, b)
            assert part.evidence(b, a) == whole.evidence(b, a)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_left_without_the_pairs_goes_on(kind: str) -> None:
    whole, shared = new(kind, 8, None), new(kind, 8, range(8))
    for bits, known in readings(1, 8, unknown=True):
        whole.learn(bits, known)
        shared.learn(bits, known)
    rest = whole.without_pairs()
    np.testing.assert_array_equal(whole.poc_graph().edges, rest.poc_graph().edges)
    for bits, known in readings(2, 8, unknown=True):
        rest.learn(bits, known)
        follow(rest, shared, bits, known)
        np.testing.assert_array_equal(shared.poc_graph().edges, rest.poc_graph().edges)
