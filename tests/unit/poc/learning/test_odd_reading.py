"""How odd a reading is, against a regression that is made in the plain way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.poc.learning.odd_reading import MOST, oddness
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import selection


def plain(rows: list[list[float]], now: list[float], sensor: int) -> float:
    """Return by how much a reading misses its guess from all others that are known."""
    table = np.array(rows)
    mean = np.array(
        [
            col[~np.isnan(col)].mean() if (~np.isnan(col)).any() else 0.0
            for col in table.T
        ]
    )
    apart = np.nan_to_num(table - mean)
    spread = apart.T @ apart / len(table)
    spread += np.diag(0.1 * spread.diagonal() + 1e-3)
    others = [k for k, read in enumerate(now) if k != sensor and not np.isnan(read)]
    slopes = np.linalg.solve(spread[np.ix_(others, others)], spread[others, sensor])
    guess = mean[sensor] + slopes @ (np.array(now)[others] - mean[others])
    return float(abs(now[sensor] - guess))


READINGS = st.sampled_from([0.0, 1.0, np.nan])


@given(
    st.integers(2, 5).flatmap(
        lambda n: st.lists(
            st.lists(READINGS, min_size=n, max_size=n), min_size=2, max_size=70
        )
    )
)
def test_it_is_by_how_much_the_best_linear_guess_is_missed(
    rows: list[list[float]],
) -> None:
    *before, now = rows
    history = History(len(now), 64)
    for row in before:
        history.record(np.array(row) == 1, ~np.isnan(row))
    asked = np.flatnonzero(~np.isnan(now))
    seen = selection(np.array(now) == 1, ~np.isnan(now))
    wanted = [plain(before[-64:], now, k) for k in asked.tolist()]
    assert oddness(history, asked, seen) == pytest.approx(wanted)


def test_of_many_sensors_those_count_that_go_with_what_is_asked() -> None:
    rng, sensors = np.random.default_rng(0), 2 * MOST
    history = History(sensors, 1024)
    for bits in rng.random((1024, sensors)) < 0.5:
        bits[-1], bits[-2] = bits[0], ~bits[1]
        history.record(bits)
    now = np.zeros(sensors, np.bool_)
    now[-2:] = True
    assert oddness(history, np.array([0, 1]), selection(now, None)) == pytest.approx(
        [1, 0], abs=0.3
    )
    many = np.arange(MOST + 1)
    assert not oddness(history, many, selection(now, None)).any()
    assert not oddness(History(sensors, 64), many[:2], selection(now, None)).any()
