"""What breaks again and again is retired, and returns when it has held for long."""

from collections.abc import Iterator, Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.protocol.anomaly_report import with_support
from neurosnap.protocol.worn_links import CAP, ENOUGH, WEIGHT, WornLinks

Row = tuple[int | None, ...]
LENGTH, RULE = 64, (0, 2)
ALL, NONE = [((each,) * 6) for each in (1, 0)]


def held(rows: Sequence[Row], after: int) -> int:
    """Count occasions among the rows that are kept, begun after one of them."""
    kept = max(0, len(rows) - LENGTH)
    begun = [
        rows[at]
        for at in range(max(kept, after + 1), len(rows))
        if at == kept or rows[at - 1] != rows[at]
    ]
    return min(begun.count((1, 1)), begun.count((0, 0)))


def by_hand(rows: Sequence[Row]) -> Iterator[tuple[int, int] | None]:
    """Yield since when and when the rule is retired, for each row that breaks it."""
    total, since, retired, last = 0, 0, 0, -1
    for now, row in enumerate(rows):
        if row != (1, 0):
            continue
        returns = None
        if not now or rows[now - 1] != row:
            total = max(0, total - held(rows[:now], last))
            if not total:
                returns = (since, 0) if retired else None
                since, retired = now + 1, 0
            total = min(CAP, total + WEIGHT)
            retired = retired or (total >= ENOUGH) * (now + 1)
        last = now
        yield (since, retired) if retired else returns


ROWS = st.lists(st.sampled_from([(0, 0), (1, 1), (0, 1), (1, 0), (1, 0)]), max_size=6)
STRETCHES = st.lists(st.tuples(ROWS, st.integers(1, 30)), max_size=8)


@given(STRETCHES, st.integers(0, 300), st.booleans())
def test_it_is_retired_and_returns_as_by_hand(
    stretches: list[tuple[list[Row], int]], resumed: int, other: bool
) -> None:
    rows = [row for some, times in stretches for row in some * times]
    history, worn, said = History(2, LENGTH), WornLinks(), by_hand(rows)
    for now, row in enumerate(rows):
        if now == resumed:
            state, worn = worn.arrays(), WornLinks()
            worn.restore(state)
        if row == (1, 0):
            rule = (3, 1) if other and now % 2 else RULE  # its contrapositive
            found = worn.follow(now + 1, {RULE, rule}, {rule}, history).get(RULE)
            assert found == next(said)
        history.record(np.array(row, np.bool_))


def test_one_rule_cries_wolf_and_another_is_told_until_it_returns() -> None:
    graph = PocGraph.from_implications(6, [(0, 2), (4, 6), (6, 10), (8, 2)])
    holds, wolf = [ALL, NONE], [(1, 0, 1, 1, 0, 1), NONE]  # at first: too rarely
    rows: list[Row] = [*holds * 5, *wolf * 6, *holds * 15, *wolf * 8]
    rows += [*[(1, 0, 1, 0, 0, 1), NONE] * 3, *wolf * 40, ALL, (0, 0, 1, 1, 1, 1), NONE]
    rows += [*[(0, 0, 1, None, 0, 0), NONE] * 7, *holds * CAP, *wolf]
    rows[60] = rows[68]  # both at once
    detector, other = (AnomalyDetector(6, support=10) for _ in range(2))
    found = dict[int, wire.Anomaly]()
    for tick, row in enumerate(rows, 1):
        if tick == 100:
            other = AnomalyDetector(6, support=10)
            other.restore(detector.to_bytes())
        seen = np.array(row) == 1, np.array([each is not None for each in row])
        anomaly = detector.watch(tick, graph, *seen)
        assert other.watch(tick, graph, *seen) == anomaly
        if (rest := anomaly and with_support(anomaly, 10)) is not None:
            found[tick] = rest
    three, fault, last = range(69, 74, 2), 156, len(rows) - 1
    assert [*found] == [*range(53, 62, 2), *three, fault, *range(158, 171, 2), last]
    first = {tick: each.links[0] for tick, each in found.items()}
    worn = {tick: (one.worn, one.retired) for tick, one in first.items() if one.worn}
    assert worn == {61: (53, 61), last: (53, 0)}
    assert found[fault].culprits == (4,)  # and not 1, of which a retired rule is
    assert {link.source for tick in three for link in found[tick].links} == {4}
