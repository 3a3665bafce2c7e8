"""What is drawn of a long curve."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.figures.plots import Scale, drawn


@pytest.mark.parametrize("scale", ["log", "linear"])
@given(count=st.integers(1, 20_000), seed=st.integers(0, 9))
def test_a_column_keeps_its_least_and_its_largest(
    scale: Scale, count: int, seed: int
) -> None:
    mean = np.random.default_rng(seed).integers(0, 50, count).astype(float)
    places = drawn(mean, scale)
    assert (np.diff(places) > 0).all()
    assert (places[0], places[-1]) == (0, count - 1)
    assert len(places) <= 2 * 800 + 2
    spaced = np.geomspace if scale == "log" else np.linspace
    edges = np.unique(spaced(1, count + 1, 801).astype(int)) - 1
    shown = mean[places]
    for start, stop in pairwise(edges.tolist()):
        within = shown[(places >= start) & (places < stop)]
        assert within.min() == mean[start:stop].min()
        assert within.max() == mean[start:stop].max()


@pytest.mark.parametrize("scale", ["log", "linear"])
def test_a_short_curve_is_drawn_whole(scale: Scale) -> None:
    assert drawn(np.arange(200.0), scale).tolist() == list(range(200))
