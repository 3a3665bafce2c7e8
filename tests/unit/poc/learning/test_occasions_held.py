"""A history and the table of relations count the same occasions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.pairs import pair_of
from neurosnap.poc.learning.reading_history import History

SENSORS, LENGTH = 3, 64
TICKS = st.lists(
    st.lists(st.sampled_from([0.0, 1.0, float("nan")]), min_size=3, max_size=3),
    min_size=1,
    max_size=200,
)
CELLS = {(0, 0): 0, (0, 1): 1, (1, 0): 2, (1, 1): 3}


@given(TICKS)
def test_they_are_those_of_the_last_ticks(rows: list[list[float]]) -> None:
    counts = count_pairs(Columns.of(rows[-LENGTH:])).occasions
    links = [
        (a, b)
        for a in range(2 * SENSORS)
        for b in range(2 * SENSORS)
        if a >> 1 != b >> 1
    ]
    sources, targets = np.array(links).T
    history = History(SENSORS, LENGTH)
    for row in rows:
        history.record(np.array(row) == 1, ~np.isnan(row))
    held = history.occasions_held(sources, targets)

    def runs(a: int, b: int) -> int:
        """Occasions with both literals on, as the table counts them."""
        if a < b:
            a, b = b, a
        return int(counts[CELLS[a & 1, b & 1], pair_of(a, b)])

    expected = [min(runs(a, b), runs(a ^ 1, b ^ 1)) for a, b in links]
    assert held.tolist() == expected
