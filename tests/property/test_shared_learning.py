"""Snapshots that share the pairs, or are cut into bands, equal one of all pairs."""

import random
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.poc.learning.snapshot_bands import Stretch, head_of, joined, stretches_of
from neurosnap.protocol.key_frames import bands_of, order_of
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
    single = whole.from_arrays(whole.arrays())
    single._stand_apart()
    expected, found = single.arrays(), [part.arrays() for part in parts]
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


MAKERS: dict[str, Callable[[int], Snapshot]] = {
    "empirical": lambda count: EmpiricalSnapshot(count, 0.1),
    "auto": lambda count: EmpiricalSnapshot(count, "auto"),
    "discounted": lambda count: DiscountedSnapshot(count, 0.1, 0.9),
}


def learned(kind: str, sensors: int, ticks: int, unknown: bool, seed: int) -> Snapshot:
    draw = np.random.default_rng(seed)
    snapshot = MAKERS[kind](sensors)
    for _ in range(ticks):
        known = draw.random(sensors) < 0.8 if unknown else None
        snapshot.observe(draw.random(sensors) < 0.5, known)
    return snapshot


@given(
    kind=st.sampled_from(sorted(MAKERS)),
    sensors=st.integers(0, 9),
    ticks=st.integers(0, 20),
    unknown=st.booleans(),
    most=st.integers(1, 50),
    seed=st.integers(0, 2**32 - 1),
)
def test_bands_in_any_order_make_the_snapshot(
    kind: str, sensors: int, ticks: int, unknown: bool, most: int, seed: int
) -> None:
    snapshot = learned(kind, sensors, ticks, unknown, seed)
    stretches = list(stretches_of(snapshot, most))
    random.Random(seed).shuffle(stretches)
    again = joined(head_of(snapshot), stretches)
    assert type(again) is type(snapshot)
    assert again.to_bytes() == snapshot.to_bytes()
    again.observe(np.ones(sensors, np.bool_))
    snapshot.observe(np.ones(sensors, np.bool_))
    assert again.to_bytes() == snapshot.to_bytes()


@given(
    kind=st.sampled_from(sorted(MAKERS)),
    sensors=st.integers(0, 9),
    cuts=st.lists(st.integers(0, 9), max_size=3),
    unknown=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_order_made_share_by_share_is_that_of_the_snapshot(
    kind: str, sensors: int, cuts: list[int], unknown: bool, seed: int
) -> None:
    snapshot = learned(kind, sensors, 20, unknown, seed)
    inner = sorted(min(cut, sensors) for cut in cuts)
    shares = [range(*ends) for ends in pairwise([0, *inner, sensors])]
    head = head_of(snapshot)
    single = snapshot.from_arrays(snapshot.arrays())
    single._stand_apart()
    bands = [*bands_of(single, 20, 7, "worker/0", shares)]
    frame = wire.KeyFrame(20, head, bands=len(bands))
    order = order_of(frame, bands, shares)
    edges = snapshot.poc_graph().edges
    np.testing.assert_array_equal(order.poc_graph().edges, edges)
    np.testing.assert_array_equal(single.poc_graph().edges, edges)
    assert order.to_bytes() == snapshot.without_pairs().to_bytes()
    if bands and single.arrays()["since"].size:
        with pytest.raises(InvalidValueError, match="must be there once"):
            order_of(frame, bands[1:], shares)


def test_they_copy_nothing_and_none_is_larger_than_asked() -> None:
    snapshot = learned("auto", 8, 30, False, 1)
    arrays = snapshot.arrays()
    sizes = dict.fromkeys(("joints", "codes", "since"), 0)
    for name, offset, data in stretches_of(snapshot, 9):
        numbers = np.frombuffer(data, arrays[name].dtype)
        assert 1 <= numbers.size <= 9
        assert np.shares_memory(numbers, arrays[name])
        assert offset == sizes[name]
        sizes[name] += numbers.size
    assert set(sizes.values()) == {28}
    assert len(head_of(snapshot)) < len(snapshot.to_bytes())


def shifted(several: list[Stretch]) -> list[Stretch]:
    """Let one overlap the one before it, as far as a place behind it stays empty."""
    return [several[0], several[1]._replace(offset=several[1].offset - 1), *several[2:]]


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (
            lambda several: several[1:],
            "joints: must be there once from its start to its end",
        ),
        (
            lambda several: several[:-1],
            "since: must be there once from its start to its end",
        ),
        (lambda several: [*several, several[0]], "joints: must be there once"),
        (shifted, "joints: must be there once"),
        (
            lambda several: [several[0]._replace(offset=2**40), *several[1:]],
            "joints: must have 28 numbers, got more",
        ),
        (
            lambda several: [several[0]._replace(array="clock"), *several[1:]],
            "clock: must be of pairs, and in the head",
        ),
        (
            lambda several: [several[0]._replace(data=several[0].data[:-1])],
            "buffer size must be a multiple of element size",
        ),
    ],
)
def test_what_does_not_make_one_is_refused(
    change: Callable[[list[Stretch]], list[Stretch]], rule: str
) -> None:
    snapshot = learned("empirical", 8, 30, False, 1)
    stretches = change(list(stretches_of(snapshot, 9)))
    with pytest.raises(InvalidValueError, match=f"^bands: must be a Snapshot .*{rule}"):
        joined(head_of(snapshot), stretches)


@pytest.mark.parametrize("head", [b"", b"no archive", "whole"])
def test_what_is_no_head_is_refused(head: Any) -> None:
    snapshot = learned("empirical", 8, 30, False, 1)
    if head == "whole":
        head = snapshot.to_bytes()
    with pytest.raises(InvalidValueError, match=r"^bands: must be a Snapshot"):
        joined(head, stretches_of(snapshot, 9))
