"""Evidence by levels: what is learned of steps, and how far evidence goes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.health.level_evidence import (
    STRETCH,
    TOP,
    WINDOWS,
    Levels,
    Moments,
    Peaks,
    learn,
    note_peaks,
)
from neurosnap.health.level_model import FEATURES


@given(st.integers(2, 30), st.integers(0, 100))
def test_it_learns_the_mean_and_covariance_of_the_features(
    steps: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    on, known = rng.random((2, steps, 2))
    known[:, 1] = 1.0
    lately = np.full(2, np.nan)
    moments = Moments.none(2)
    learn(Levels(on, known), lately, moments)
    rows, mean = [], on[0]
    for level, share in zip(on, known, strict=True):
        mean = mean + (level - mean) / 50
        rows.append(np.column_stack([level, mean, share]).ravel())
    features = np.array(rows)
    assert np.allclose(lately, mean)
    assert np.allclose(moments.mean(), features.mean(0))
    assert np.allclose(moments.covariance(), np.cov(features.T, bias=True))


def test_what_is_unknown_counts_as_the_mean() -> None:
    on = np.array([[0.0], [1.0], [1.0], [1.0]])
    known = np.array([[1.0], [1.0], [0.0], [0.0]])
    moments = Moments.none(1)
    learn(Levels(on, known), np.full(1, np.nan), moments)
    assert moments.mean()[0] == 0.5
    assert moments.mean()[FEATURES - 1] == 0.5


@given(st.integers(0, 100), st.integers(1, 400))
def test_peaks_are_the_largest_of_each_stretch(seed: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    evidence = rng.random((steps, 2))
    judged = np.array([True, False])
    peaks = Peaks.none(2)
    for row in evidence:
        note_peaks(np.tile(row, (len(WINDOWS), 1)), judged, peaks)
    for w, window in enumerate(WINDOWS.tolist()):
        length = STRETCH * window
        whole = evidence[: steps // length * length, 0].reshape(-1, length)
        largest = np.sort(whole.max(1))[::-1][: TOP + 1]
        assert peaks.stretches[w] == len(whole)
        assert np.allclose(peaks.top[w, 0, : len(largest)], largest)
        assert not peaks.top[w, 0, len(largest) :].any()
        assert not peaks.top[w, 1].any()
