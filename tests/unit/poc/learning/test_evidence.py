"""What a snapshot can say for an implication, and since when."""

from typing import TypeAlias

import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.poc.learning.pairs import Evidence

Kind: TypeAlias = type[EmpiricalSnapshot] | type[DiscountedSnapshot]
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


def test_counts_stand_for_and_against() -> None:
    snapshot = EmpiricalSnapshot(2, 0.2)
    for bits in [(0, 0)] * 5 + [(0, 1)] * 4 + [(1, 1)] * 3 + [(1, 0)] * 2:
        snapshot.learn(bits)
    limit = 0.2 * 14
    assert snapshot.evidence(0, 2) == Evidence(14, 3, 5, 4, 2, limit, True, 10)
    assert snapshot.evidence(3, 1) == Evidence(14, 5, 3, 4, 2, limit, True, 10)
    assert snapshot.evidence(2, 0) == Evidence(14, 3, 5, 2, 4, limit, False, 10)
    assert snapshot.evidence(0, 3) == Evidence(14, 2, 4, 5, 3, limit, False, 10)
    assert type(snapshot.evidence(0, 2).against) is int


def test_shares_stand_for_and_against() -> None:
    snapshot = DiscountedSnapshot(2, 0.25, decay=0.5)
    for bits in [(0, 0), (0, 1), (1, 1)]:
        snapshot.learn(bits)
    found = snapshot.evidence(0, 2)
    assert (found.total, found.limit, found.against) == (1.0, 0.25, 0.0)
    assert (found.both, found.neither, found.other) == (0.5625, 0.1875, 0.25)
    assert found.holds
    assert found.since == 3


@KINDS
def test_since_is_when_the_pair_changed_and_no_other(kind: Kind) -> None:
    snapshot = kind(3, 0.25)
    dates: dict[tuple[int, int], int] = {}
    below = [(0, 0, 0), (0, 1, 0), (1, 1, 0)]
    apart = [(0, 0, 1), (0, 1, 1), (1, 1, 1)]
    for tick, bits in enumerate(below * 2 + apart * 2, 1):
        before = snapshot.poc_graph().edges
        snapshot.learn(bits)
        after = snapshot.poc_graph().edges
        for i, j in [(0, 1), (0, 2), (1, 2)]:
            square = slice(2 * i, 2 * i + 2), slice(2 * j, 2 * j + 2)
            if (before[square] != after[square]).any():
                dates[i, j] = tick
    assert len(set(dates.values())) > 1
    for (i, j), tick in dates.items():
        assert snapshot.evidence(2 * i, 2 * j).since == tick
        assert snapshot.evidence(2 * j + 1, 2 * i).since == tick


@KINDS
def test_a_snapshot_that_saw_nothing_has_no_evidence(kind: Kind) -> None:
    found = kind(2).evidence(0, 2)
    assert not found.holds
    assert found.since == 0
    assert found.both == found.neither == found.other == found.against


def test_thresholds_are_of_the_pair() -> None:
    snapshot = EmpiricalSnapshot(
        3, [[0.2, 0.1, 0.2], [0.1, 0.2, 0.05], [0.2, 0.05, 1 / 4]]
    )
    snapshot.learn([1, 1, 1])
    limits = [snapshot.evidence(a, b).limit for a, b in [(0, 2), (0, 4), (3, 5)]]
    assert limits == [0.1, 0.2, 0.05]


def test_evidence_is_of_a_proper_pair() -> None:
    snapshot = EmpiricalSnapshot(2)
    rule = r"^pair: must be of two sensors, got \(0, 1\)$"
    with pytest.raises(InvalidValueError, match=rule):
        snapshot.evidence(0, 1)
    with pytest.raises(InvalidValueError, match=r"^a: must be a literal, .* got 4$"):
        snapshot.evidence(4, 0)


@KINDS
@pytest.mark.parametrize("known", [None, [True, True, False]])
def test_dates_are_kept_in_the_file(kind: Kind, known: list[bool] | None) -> None:
    snapshot = kind(3, 0.25)
    for bits in [(0, 0, 0), (0, 1, 1), (1, 1, 0)] * 9:
        snapshot.observe(bits, known)
    twin = kind.from_bytes(snapshot.to_bytes())
    assert twin.evidence(0, 2) == snapshot.evidence(0, 2)
    assert twin.evidence(0, 2).since > 0
    twin.learn([1, 0, 0])
    snapshot.learn([1, 0, 0])
    assert twin.to_bytes() == snapshot.to_bytes()
