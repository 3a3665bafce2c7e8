"""Means, waiting times and fitted rates of curves, where the right values are known."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.paper.curves import Curve, fitted
from tools.paper.learning_error import LearningEntry

ENTRY = LearningEntry(
    setting="path",
    threshold=1 / 8000,
    decay=None,
    truth="contained",
    runs=2,
    steps=300,
    seed=5,
)


def curve(*rows: list[int] | list[float]) -> Curve:
    table = np.array(rows).round().astype(np.uint16)
    runs, steps = table.shape
    return Curve(msgspec.structs.replace(ENTRY, runs=runs, steps=steps), table)


def falling(half_life: float, steps: int = 400, floor: float = 0) -> Curve:
    top = 40_000
    return curve((top * 2.0 ** (-np.arange(steps) / half_life) + floor).tolist())


def test_a_curve_is_the_mean_of_its_runs_its_level_that_of_the_last_tenth() -> None:
    assert curve([100] * 18 + [6, 2]).level == 4
    assert curve([8, 2]).level == 2
    found = curve([4, 2, 2, 0], [4, 4, 0, 0])
    assert found.mean.tolist() == [4, 3, 1, 0]
    assert (found.woken, found.peak, found.halved) == (2, 1, 3)
    assert found.reaches_zero
    assert not curve([4, 0], [4, 2]).reaches_zero


def test_the_peak_is_its_last_step_and_the_wait_is_counted_from_it() -> None:
    found = curve([1, 9, 9, 8, 4, 9, 5, 4])
    assert found.peak == 6
    assert found.halved == 8
    flat = curve([6] * 20)
    assert (flat.peak, flat.halved, flat.woken) == (20, None, None)


@given(st.floats(5, 40))
def test_the_rate_of_an_exponential_is_found(half_life: float) -> None:
    fit = fitted(falling(half_life))
    assert fit is not None
    assert fit.half_life == pytest.approx(half_life, rel=0.03)  # it is rounded to edges
    assert fit.rate == pytest.approx(np.log(2) / fit.half_life)
    assert fit.r2 > 0.99
    assert fit.first == 1


def test_the_fit_ends_where_the_plateau_begins() -> None:
    found = falling(10, floor=100)
    fit = fitted(found)
    assert fit is not None
    assert found.mean[fit.last - 1] <= 110 < found.mean[fit.last - 2]


def test_the_fit_ends_with_the_first_mean_of_one_edge_or_less() -> None:
    rows = [[64, 32, 16, 8, 4, 2, 2, 0, 0, 50] + [0] * 20] * 3
    rows.append([64, 32, 16, 8, 4, 2, 0, 0, 0, 50] + [0] * 20)
    fit = fitted(curve(*rows))
    assert fit is not None
    assert (fit.first, fit.last) == (1, 7)


@pytest.mark.parametrize(
    "row",
    [
        [50] * 30,  # nothing falls
        list(range(1, 31)),  # it rises
        [50] * 10 + [30] * 20,  # it does not halve
        [50] * 10 + [0] * 20,  # it falls at once
        [0] * 30,
        [7],
    ],
)
def test_what_does_not_decay_has_no_rate(row: list[int]) -> None:
    assert fitted(curve(row)) is None
