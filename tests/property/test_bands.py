"""Bands of a snapshot join into the same snapshot; wrong bands are refused."""

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
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.learning.snapshot_bands import Stretch, head_of, joined, stretches_of
from neurosnap.protocol.key_frames import bands_of, order_of, snapshot_of

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
    bands = [*bands_of(snapshot, 20, 7, "worker/0", shares)]
    head = head_of(snapshot)
    frame = wire.KeyFrame(20, head, bands=len(bands))
    order = order_of(frame, bands, shares)
    whole = snapshot_of(frame, bands)
    edges = snapshot.poc_graph().edges
    np.testing.assert_array_equal(order.poc_graph().edges, edges)
    np.testing.assert_array_equal(whole.poc_graph().edges, edges)
    assert order.to_bytes() == whole.without_pairs().to_bytes()
    if bands and snapshot.arrays()["since"].size:
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
