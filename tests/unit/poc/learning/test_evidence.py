"""What a snapshot can say for an implication, and since when."""

from typing import TypeAlias

import pytest

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
def test_a_snapshot_that_saw_nothing_has_no_evidence(kind: Kind) -> None:
    found = kind(2).evidence(0, 2)
    assert not found.holds
    assert found.since == 0
    assert found.both == found.neither == found.other == found.against
