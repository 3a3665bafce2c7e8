"""The benefit of automatic thresholds, measured on a small scale."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap import EmpiricalSnapshot
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.relation_table import tabulate
from tests.support.exhaustive import rows
from tests.support.planted import planted
from tools.paper.learners import THRESHOLDS
from tools.paper.learning_error import errors
from tools.paper.walks import Walk, walk

pytestmark = pytest.mark.slow
RUNS, STEPS = 6, 3000
CHECKED = [199, 399, 799, 1199, 1599, 1999, 2499, 2999]
ONE = 2 / RUNS
"""An implication that is wrong in one of the runs, with its contrapositive."""
Errors = NDArray[np.float64]


def mean_errors(setting: str, noise: float) -> tuple[Errors, Errors]:
    """The mean Err of auto, and of each fixed threshold, at every step.

    Bits flip with a chance of `noise` from step 1,000 to 2,000.
    """
    found = []
    for run in range(RUNS):
        seen = walk(setting, 3, run, STEPS)
        readings = seen.fields.T[seen.places]
        flips = np.random.default_rng(run).random(readings.shape) < noise
        readings[1000:2000] ^= flips[1000:2000]
        # Each reading is a place of its own.
        noisy = Walk(readings.T, seen.moves, np.arange(STEPS))
        found.append(
            [
                errors(noisy, EmpiricalSnapshot(len(seen.fields), tau), seen.contained)
                for tau in ("auto", *THRESHOLDS)
            ]
        )
    auto, *fixed = np.mean(found, axis=0)
    return auto, np.array(fixed)


@pytest.mark.parametrize("setting", rows(["random"], ["path", "cycle", "grid"]))
def test_it_is_as_good_as_the_best_of_ten_fixed_ones(setting: str) -> None:
    auto, fixed = mean_errors(setting, 0)
    best = fixed.min(axis=0)
    assert (auto[CHECKED] <= np.maximum(1.5 * best, ONE)[CHECKED]).all()
    assert best[199] > 0  # there is something to be wrong about


def test_it_follows_noise_where_no_fixed_one_can() -> None:
    auto, fixed = mean_errors("grid", 0.005)
    later = slice(1600, STEPS)
    assert auto[later].mean() < fixed[:, later].mean(axis=1).min() / 2


@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_what_is_planted_is_found_whole_and_nothing_else(noise: float) -> None:
    wanted = planted(1, noise)
    columns = Columns.of(wanted.table)
    rows = tabulate(columns, EmpiricalSnapshot.fit(columns, "auto"), every=True)
    found = Counter(
        (
            row.relation.removeprefix("nearly "),
            frozenset((int(row.a[1:]), int(row.b[1:]))),
        )
        for row in rows
    )
    implied = {
        (int(r.a[1:]), int(r.b[1:])) for r in rows if r.relation.endswith("implies")
    }
    assert implied == wanted.implied
    told = {pair for kind, pair in found if kind == "never together"}
    assert told == wanted.exclusions
    copies = {pair for kind, pair in found if kind == "the same"}
    assert copies == wanted.copies
    assert len(rows) == len(implied) + len(told) + len(copies)
    usual = EmpiricalSnapshot.fit(columns).codes
    assert np.count_nonzero(usual) > 2 * len(rows)  # most of them by chance
