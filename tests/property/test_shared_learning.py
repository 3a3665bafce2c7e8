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
from neurosnap.poc.learning.reading_history import Newborn
from neurosnap.poc.learning.snapshot import OF_PAIRS, Snapshot
from neurosnap.poc.learning.snapshot_bands import (
    Stretch,
    assembled,
    count_of,
    head_of,
    joined,
    lacking,
    stretches_of,
)
from neurosnap.protocol.key_frames import bands_of, order_of, snapshot_of
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
    """Sensors that stay for a while, some copies of others, some never known.

    Or they change rarely, and are copies up to a tick of their own: so twins part when
    most pairs have long been left alone.
    """
    rng = np.random.default_rng(seed)
    ticks, rare = rng.integers(50, 100), rng.random() < 0.5
    ticks, often = (2 * ticks, 0.01) if rare else (ticks, 0.2)
    until = rng.integers(ticks, size=sensors) if rare else np.full(sensors, ticks)
    of = np.arange(sensors)
    of[1::3] = of[: len(of[1::3])]
    bits, some = rng.integers(0, 2, sensors), []
    for tick in range(ticks):
        bits = np.where(rng.random(sensors) < often, rng.integers(0, 2, sensors), bits)
        bits = np.where(tick < until, bits[0 * of if rare else of], bits)
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
        told = [order.learn(bits, known)]
        told += [follow(order, part, bits, known) for part in parts]
        assert any(told) == changed
        np.testing.assert_array_equal(whole.poc_graph().edges, order.poc_graph().edges)
    assert_same(whole, parts, order)
    head = head_of(order)
    again = [through_bands(head, part) for part in parts if len(part.share)]
    for bits, known in readings(seed + 1, sensors, unknown):
        for each in (whole, order, *again):
            each.learn(bits, known)
    assert_same(whole, again, order)


def follow(
    order: Snapshot, part: Snapshot, bits: np.ndarray, known: np.ndarray | None
) -> bool:
    """Let a share learn, and the order follow what it says changed."""
    part.learn(bits, known)
    pieces = pieces_of(0, part.clock, part.changes(), most=8)
    told = [order.relate(*pairs_in(piece, part.share)) for piece in pieces]
    return any(told)


def assert_same(whole: Snapshot, parts: list[Snapshot], order: Snapshot) -> None:
    """Together the shares are the snapshot, and the rest is all there is besides."""
    head, shared = head_of(order), [one for one in parts if len(one.share)]
    assert count_of(order, 7, [one.share for one in shared]) == sum(
        len([*stretches_of(one, 7)]) for one in shared
    )
    again = assembled(head, [through_bands(head, one) for one in shared])
    again.adopt(whole.state)
    assert again.to_bytes() == whole.to_bytes()
    for name, array in order.arrays().items():
        if name in OF_PAIRS:
            assert array.size == 0
        elif name != "state":
            np.testing.assert_array_equal(array, whole.arrays()[name])


def through_bands(head: bytes, part: Snapshot) -> Snapshot:
    """Return what the head and a share's bands say."""
    stretches = [*stretches_of(part, 7)]
    missing = lacking(head, part.share) - sum(len(one.data) for one in stretches)
    assert missing == 0
    return joined(head, stretches[::-1], part.share)


def test_twins_that_part_late_are_judged_at_once() -> None:
    """Where most pairs are left alone; and where one is listed, so is its twin's.

    Before the share each two read the same, until one of them turns back a tick after
    both have changed.
    """
    rng = np.random.default_rng(2)
    base, own = 70, 20
    share = range(2 * base, 2 * base + own)
    whole, order = new("fixed", share.stop, None), new("fixed", share.stop, range(0))
    parts = [new("fixed", share.stop, one) for one in (range(share.start), share)]
    whole.stand_apart()
    bits, flips = np.zeros(share.stop, np.int64), np.zeros(share.stop, np.bool_)
    for tick in range(250):
        changed = flips[:base]
        flips = rng.random(share.stop) < (0.5 if tick < 10 else 0.005)
        late = changed & (rng.random(base) < 0.3 * (tick > 130))
        flips[base : 2 * base] = flips[:base] ^ late
        bits ^= flips
        whole.learn(bits)
        order.learn(bits)
        for part in parts:
            follow(order, part, bits, None)
        np.testing.assert_array_equal(whole.poc_graph().edges, order.poc_graph().edges)


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
@given(
    seed=st.integers(0, 2**32 - 1),
    cuts=st.lists(st.integers(0, 7), max_size=3),
    retires=st.integers(0, 5),
)
def test_what_comes_and_goes_is_in_the_share_that_has_its_pairs(
    kind: str, seed: int, cuts: list[int], retires: int
) -> None:
    """The last sensor is not read before it is grown."""
    shares = [range(*ends) for ends in pairwise([0, *sorted(cuts), 7])]
    whole, order = new(kind, 7, None), new(kind, 7, range(0))
    parts = [new(kind, 7, share) for share in shares]
    rng = np.random.default_rng(seed)
    for tick, (bits, _) in enumerate(readings(seed, 7, unknown=False)):
        known = np.arange(7) < (6 if tick < 30 else 7)
        told = [whole.learn(bits, known), order.learn(bits, known)]
        told += [follow(order, part, bits, known) for part in parts]
        assert told[0] == any(told[1:])
        if tick == 29:
            counts = rng.multinomial(10, [0.4, 0.3, 0.3, 0], 6).T.astype(np.uint32)
            newborn = Newborn(10, *whole._judge_newborn(counts.copy(), 10))
            for one in (whole, order, *parts):
                one.grow(6, "grown", newborn, None)
            dated = [whole.evidence(12, 2 * k).since for k in range(6)]
            assert dated == [30 * bool(code) for code in newborn.codes]
        if tick == 40:
            for one in (whole, order, *parts):
                one.silence(retires)
        np.testing.assert_array_equal(whole.poc_graph().edges, order.poc_graph().edges)
    assert_same(whole, parts, order)


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


def learned(
    kind: str,
    sensors: int,
    ticks: int,
    unknown: bool,
    seed: int,
    share: range | None = None,
    *,
    twins: bool = False,
) -> Snapshot:
    """Return what was learned of sensors, each two of which may read the same."""
    draw = np.random.default_rng(seed)
    snapshot = new(kind, sensors, share)
    for _ in range(ticks):
        known = draw.random(sensors) < 0.8 if unknown else None
        bits = draw.random(sensors) < 0.5
        snapshot.learn(bits.repeat(2)[:sensors] if twins else bits, known)
    return snapshot


@given(
    kind=st.sampled_from(KINDS),
    sensors=st.integers(0, 9),
    ticks=st.integers(0, 20),
    unknown=st.booleans(),
    most=st.integers(1, 50),
    seed=st.integers(0, 2**32 - 1),
    twins=st.booleans(),
)
def test_bands_in_any_order_make_the_snapshot(
    kind: str,
    sensors: int,
    ticks: int,
    unknown: bool,
    most: int,
    seed: int,
    twins: bool,
) -> None:
    snapshot = learned(kind, sensors, ticks, unknown, seed, twins=twins)
    stretches = list(stretches_of(snapshot, most))
    random.Random(seed).shuffle(stretches)
    again = joined(head_of(snapshot), stretches)
    assert type(again) is type(snapshot)
    assert again.to_bytes() == snapshot.to_bytes()
    again.observe(np.ones(sensors, np.bool_))
    snapshot.observe(np.ones(sensors, np.bool_))
    assert again.to_bytes() == snapshot.to_bytes()


@given(
    kind=st.sampled_from(KINDS),
    sensors=st.integers(0, 9),
    cuts=st.lists(st.integers(0, 9), max_size=3),
    unknown=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
    twins=st.booleans(),
)
def test_the_order_made_share_by_share_is_that_of_the_snapshot(
    kind: str, sensors: int, cuts: list[int], unknown: bool, seed: int, twins: bool
) -> None:
    def among(share: range | None = None) -> Snapshot:
        return learned(kind, sensors, 20, unknown, seed, share, twins=twins)

    snapshot = among()
    inner = sorted(min(cut, sensors) for cut in cuts)
    shares = [range(*ends) for ends in pairwise([0, *inner, sensors])]
    head = head_of(snapshot)
    parts = map(among, shares)
    bands = [band for one in parts for band in bands_of(one, 20, 7, "worker/0")]
    frame = wire.KeyFrame(20, head, bands=len(bands))
    order = order_of(frame, bands, shares)
    edges = snapshot.poc_graph().edges
    np.testing.assert_array_equal(order.poc_graph().edges, edges)
    assert order.to_bytes() == snapshot.without_pairs().to_bytes()
    assert snapshot_of(frame, bands, shares).to_bytes() == snapshot.to_bytes()
    if bands:
        with pytest.raises(InvalidValueError, match="must be there once"):
            order_of(frame, bands[1:], shares)


def test_they_copy_nothing_and_none_is_larger_than_asked() -> None:
    snapshot = learned("auto", 8, 30, False, 1)
    snapshot = Snapshot.from_bytes(snapshot.to_bytes())  # numbered as it is saved
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
            "joints: must have 28 numbers in a row, got more",
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
    snapshot = learned("fixed", 8, 30, False, 1)
    stretches = change(list(stretches_of(snapshot, 9)))
    with pytest.raises(InvalidValueError, match=f"^bands: must be a Snapshot .*{rule}"):
        joined(head_of(snapshot), stretches)


@pytest.mark.parametrize("head", [b"", b"no archive", "whole"])
def test_what_is_no_head_is_refused(head: Any) -> None:
    snapshot = learned("fixed", 8, 30, False, 1)
    if head == "whole":
        head = snapshot.to_bytes()
    with pytest.raises(InvalidValueError, match=r"^bands: must be a Snapshot"):
        joined(head, stretches_of(snapshot, 9))
