"""The masked regression is the conditional mean of a normal distribution."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.health.level_model import FEATURES, KNOWN, LevelModel

SIGNALS = st.lists(st.integers(1, 3), min_size=2, max_size=4)


def a_model(sizes: list[int], seed: int) -> tuple[LevelModel, np.ndarray]:
    """Return a model, and the covariance that it takes the features to have."""
    rng = np.random.default_rng(seed)
    count = FEATURES * sum(sizes)
    some = rng.normal(size=(count + 3, count))
    covariance = some.T @ some / (count + 3)
    model = LevelModel(
        rng.normal(size=count), covariance, np.cumsum([0, *sizes]).astype(np.int64)
    )
    slack = np.tile([1e-3, 1e-3, 0.05], sum(sizes))
    return model, covariance + np.diag(0.05 * covariance.diagonal() + slack)


@given(SIGNALS, st.integers(0, 1000), st.data())
def test_it_guesses_what_all_others_that_are_known_and_believed_say(
    sizes: list[int], seed: int, data: st.DataObject
) -> None:
    model, covariance = a_model(sizes, seed)
    sensors = st.lists(st.booleans(), min_size=sum(sizes), max_size=sum(sizes))
    known = np.array(data.draw(sensors))
    bad = data.draw(st.sets(st.integers(0, len(sizes) - 1), max_size=2))
    mask = model.mask(known, sorted(bad))
    deviations = np.random.default_rng(seed).normal(size=len(model.mean))
    left = np.repeat(known, FEATURES)
    left[KNOWN::FEATURES] = True
    far = mask.rows @ np.where(left, deviations, 0.0)
    bounds = np.cumsum([0, *sizes]) * FEATURES
    for signal, (low, high) in enumerate(pairwise(bounds.tolist())):
        own = np.flatnonzero(left[low:high]) + low
        others = left.copy()
        for each in {*bad, signal}:
            others[bounds[each] : bounds[each + 1]] = False
        slopes = covariance[np.ix_(own, others)]
        inner = covariance[np.ix_(others, others)]
        guess = slopes @ np.linalg.solve(inner, deviations[others])
        rest = covariance[np.ix_(own, own)] - slopes @ np.linalg.solve(inner, slopes.T)
        missed = deviations[own] - guess
        block = mask.blocks[np.ix_(own, own)]
        assert np.allclose(block @ far[own], missed)
        assert np.isclose(
            far[own] @ block @ far[own], missed @ np.linalg.solve(rest, missed)
        )
        assert mask.sizes[signal] == len(own)


def test_it_says_what_a_guess_rests_on() -> None:
    covariance = np.eye(3 * FEATURES)
    covariance[0, 2 * FEATURES] = covariance[2 * FEATURES, 0] = 0.9
    bounds = np.arange(4, dtype=np.int64)
    model = LevelModel(np.zeros(3 * FEATURES), covariance, bounds)
    assert model.leaned_on(0) == (2,)
    assert model.leaned_on(2) == (0,)
    assert 2 not in model.leaned_on(0, without=[2])
