"""What tells places apart that look alike, held against loops."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.moves import Moves
from neurosnap.agent.places_apart import (
    HIDDEN,
    SELDOM,
    expected_now,
    hidden,
    telling,
    told_before,
    told_by,
)


def test_a_coin_tells_no_place_from_another_and_a_slip_does() -> None:
    rng, size = np.random.default_rng(3), 2000
    before = rng.integers(2, size=(size, 3)).astype(np.bool_)
    after = rng.integers(2, size=(size, 3)).astype(np.bool_)
    slips = rng.random(size) < 0.2
    after[:, 0] = before[:, 0] ^ slips  # stays mostly; the others are coins
    moves = Moves(before, rng.integers(2, size=size), after, np.arange(size))
    assert telling(moves, 2).tolist() == [True, False, False]
    after[:, 2] = before[:, 1]  # what is no coin, though it tells nothing further
    assert telling(moves, 2).tolist() == [True, True, True]


def test_coins_are_rarely_taken_for_more() -> None:
    rng, taken = np.random.default_rng(4), 0
    for _ in range(200):
        before, after = rng.integers(2, size=(2, 500, 4)).astype(np.bool_)
        moves = Moves(before, rng.integers(2, size=500), after, np.arange(500))
        taken += bool(telling(moves, 2).any())
    assert taken <= 6  # of 200; two are expected at most


def test_what_the_move_before_tells_is_told_from_chance() -> None:
    rng, size = np.random.default_rng(5), 3000
    ticks = np.arange(size)
    coin = rng.integers(2, size=size)
    pairs = rng.integers(3, size=size)
    assert abs(told_before(pairs, coin, ticks)[0]) < 0.03
    told = np.roll(pairs, 1) % 2  # the move before tells all
    of_open, of_all = told_before(pairs, told, ticks)
    assert of_open == 1
    assert of_all == pytest.approx(4 / 9, abs=0.02)  # of 1/3 and 2/3
    half = np.where(rng.random(size) < 0.5, coin, told)
    assert 0.15 < told_before(pairs, half, ticks)[0] < 0.35
    # None comes right after another; or nothing is left open.
    assert told_before(pairs, told, 2 * ticks) == (0, 0)
    assert told_before(pairs, pairs, ticks) == (0, 0)


def test_what_hardly_ever_matters_hides_nothing() -> None:
    ticks = np.arange(3000)
    for every, hides in (100, False), (10, True):
        pairs = np.random.default_rng(1).integers(2, size=len(ticks))
        open_ = ticks % every == 0  # where only the move before tells
        led = np.where(open_, np.roll(pairs, 1), pairs)
        pairs[open_] = 2
        of_open, of_all = told_before(pairs, led, ticks)
        assert of_open == pytest.approx(1)
        assert of_all == pytest.approx(0.5 / every, rel=0.2)
        assert hidden(pairs, led, ticks) == hides


def test_what_is_mostly_left_to_chance_is_not_hidden() -> None:
    rng, ticks = np.random.default_rng(2), np.arange(3000)
    pairs, coin = rng.integers(3, size=3000), rng.integers(2, size=3000)
    led = np.where(rng.random(3000) < 0.26, np.roll(pairs, 1) % 2, coin)
    of_open, of_all = told_before(pairs, led, ticks)
    assert of_all > SELDOM
    assert of_open < HIDDEN
    assert not hidden(pairs, led, ticks)


@example(  # what one sensor reads always after one pair tells nothing of it
    list(
        zip(
            [0, 0, 1, 1, 0, 0, 0, 1],
            [0, 1, 0, 0, 0, 1, 1, 1],
            [3, 0, 2, 3, 3, 1, 2, 2],
            strict=True,
        )
    )
)
@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2), st.integers(0, 7)),
        min_size=1,
        max_size=14,
    )
)
def test_the_sensor_that_tells_most_is_the_one_of_all(
    moved: list[tuple[int, int, int]],
) -> None:
    """Held against all ways to choose as many moves as a sensor was on at."""
    pairs, led, codes = np.array(moved).T

    def purity(mine: NDArray[np.intp]) -> float:
        counts = np.bincount(led[mine])
        return float((counts**2).sum() / len(mine)) if len(mine) else 0.0

    def parted(whole: NDArray[np.intp], on: NDArray[np.intp]) -> float:
        return purity(on) + purity(np.setdiff1d(whole, on))

    gains, left = np.zeros(3), 0.0
    for pair in set(pairs.tolist()):
        whole = np.flatnonzero(pairs == pair)
        if len(set(led[whole].tolist())) == 1:
            continue
        for sensor in range(3):
            on = whole[codes[whole] >> sensor & 1 == 1]
            ways = combinations(whole.tolist(), len(on))
            by_accident = np.mean([parted(whole, np.array(w, np.intp)) for w in ways])
            gains[sensor] += parted(whole, on) - by_accident
        one = [parted(whole, whole[[k]]) for k in range(len(whole))]
        left += len(whole) - float(np.mean(one))
    readings = codes[:, None] >> np.arange(3) & 1 == 1
    found = told_by(pairs, led, readings)
    enough = gains.max() - HIDDEN * left
    if found is not None:
        assert gains[found] == pytest.approx(gains.max())
        assert enough > -1e-9
    elif left:
        assert enough < 1e-9


@given(st.integers(0, 10**6), st.sampled_from((0.0, 0.5, 0.9, 1.0)))
def test_what_an_action_led_to_in_this_trajectory_is_expected_again(
    seed: int, lasts: float
) -> None:
    """Held against a loop over the moves; a place's outcome lasts or is drawn anew."""
    rng = np.random.default_rng(seed)
    size = 120
    begun = rng.random(size + 1) < 0.1
    begun[0] = True
    tick = np.flatnonzero(~begun)
    pairs, led = rng.integers(3, size=len(tick)), rng.integers(2, size=len(tick))
    trajectory = np.cumsum(begun)[tick]
    last: dict[tuple[int, int], int] = {}
    before = list[int | None]()
    for k, (pair, of) in enumerate(zip(pairs, trajectory, strict=True)):
        was = last.get((pair, of))
        before.append(was)
        if was is not None and rng.random() < lasts:
            led[k] = was
        last[pair, of] = led[k]
    again = [k for k, was in enumerate(before) if was is not None]
    same = sum(led[k] == before[k] for k in again)
    chance = sum(np.mean(led[pairs == pairs[k]] == before[k]) for k in again)
    kept = expected_now(pairs, led, tick, begun)
    if same - chance <= HIDDEN * (len(again) - chance):
        assert kept.all()
        return
    now = trajectory.max() if not begun[-1] else -1
    for k, pair in enumerate(pairs):
        if (outcome := last.get((pair, now))) is None:
            assert kept[k]
        else:
            later = [*pairs[k + 1 :]].count(pair)
            newest = trajectory[k] == now and not later
            assert kept[k] == (newest or before[k] == outcome)


def test_what_chance_decides_is_not_expected_again() -> None:
    rng, kept = np.random.default_rng(1), 0
    begun = np.arange(2001) % 50 == 0
    tick = np.flatnonzero(~begun)
    for _ in range(100):
        pairs, led = rng.integers(5, size=len(tick)), rng.integers(3, size=len(tick))
        kept += bool(expected_now(pairs, led, tick, begun).all())
    assert kept == 100
