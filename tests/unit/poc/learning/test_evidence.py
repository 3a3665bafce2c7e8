"""What a snapshot can say for an implication, and since when."""

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import Evidence


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
