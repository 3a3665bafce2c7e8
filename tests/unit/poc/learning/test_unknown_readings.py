"""What unknown readings do to a snapshot, and what no longer holds with them."""

from typing import TypeAlias

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot

Kind: TypeAlias = type[EmpiricalSnapshot] | type[DiscountedSnapshot]
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


@KINDS
def test_a_bad_mask_changes_nothing(kind: Kind) -> None:
    snapshot = kind(2)
    snapshot.observe([1, 0])
    before = snapshot.to_bytes()
    rule = r"^known: must hold 2 flags, one a sensor, got \(3,\)$"
    with pytest.raises(ShapeError, match=rule):
        snapshot.observe([1, 0], [True] * 3)
    with pytest.raises(InvalidValueError, match=r"^known: must be bool, got dtype"):
        snapshot.learn([1, 0], [1, 0])
    with pytest.raises(InvalidValueError, match=r"^observation: must be 0 or 1"):
        snapshot.learn([1, np.nan], [True, False])
    assert snapshot.to_bytes() == before


@pytest.mark.parametrize(
    "square", [(0.4, 0.1, 0.3, 0.2), (0.5, -1e-17, 0.25, 0.25), (0.5, 1e-310, 0, 0.5)]
)
def test_what_is_not_touched_is_not_judged_anew(square: tuple[float, ...]) -> None:
    snapshot = DiscountedSnapshot(3, 0.25)
    snapshot.learn([1, 1, 1], known=[True, False, True])
    arrays = unpack_arrays(snapshot.to_bytes())
    # As rounding might leave it: by these weights there would be a relation.
    arrays["squares"] = np.tile(square, (3, 1)).T
    whole = DiscountedSnapshot.from_bytes(pack_arrays(arrays))
    for unknown in range(3):
        snapshot = DiscountedSnapshot.from_bytes(whole.to_bytes())
        j, i = (s for s in range(3) if s != unknown)
        assert snapshot.learn([1, 1, 1], known=[s != unknown for s in range(3)])
        edges = snapshot.poc_graph().edges
        assert edges[2 * i, 2 * j]
        for s in (i, j):
            low, high = 2 * min(s, unknown), 2 * max(s, unknown)
            around = [
                snapshot.weight(high + t, low + u) for t in (0, 1) for u in (0, 1)
            ]
            assert around == list(square)
            assert not edges[low : low + 2, high : high + 2].any()
            assert not edges[high : high + 2, low : low + 2].any()


@pytest.mark.parametrize("count", [2**31 - 2, 2**32 - 8])
def test_wide_counts_are_right_beyond_31_bits(count: int) -> None:
    snapshot = EmpiricalSnapshot(2, 0.25)
    snapshot.learn([0, 0], [False, False])
    squares = snapshot._weights.squares
    assert squares is not None
    third = count // 3
    squares[:, 0] = third, third - 1, third + 1, count - 3 * third
    snapshot._clock = count
    # s1* -> s0 with less against it than the rest and the threshold.
    assert snapshot.learn([1, 1])
    assert snapshot.evidence(3, 0).total == count + 1
    assert snapshot.evidence(3, 0).against == count - 3 * third
    assert snapshot.evidence(3, 0).holds
    twin = EmpiricalSnapshot.from_bytes(snapshot.to_bytes())
    assert twin.evidence(3, 0).holds


def test_weights_that_fade_become_nothing_in_the_end() -> None:
    snapshot = DiscountedSnapshot(2, 0.25, decay=0.75)
    snapshot.learn([0, 0], [False, False])
    for tick in range(2600):
        snapshot.learn([tick % 2] * 2)
    assert snapshot.poc_graph().classes() == [(0, 2), (1, 3)]
    assert snapshot.weight(0, 3) == snapshot.weight(1, 2) == 0.0


def test_a_long_memory_is_read_back_all_the_same() -> None:
    snapshot = DiscountedSnapshot(2, decay=1 - 2**-40)
    snapshot.learn([1, 0], [True, False])
    squares = snapshot._weights.squares
    assert squares is not None
    # Where what is gained is lost to rounding, a weight stays off by so much.
    squares[:, 0] = 1 - 2**-14, 0, 0, 0
    for _ in range(9):
        snapshot.learn([1, 1])
    assert snapshot.weight(0, 2) == 1 - 2**-14
    twin = DiscountedSnapshot.from_bytes(snapshot.to_bytes())
    assert twin.weight(0, 2) == 1 - 2**-14
