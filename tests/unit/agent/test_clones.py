"""Places that look alike are told apart by what leads to them and what follows."""

from collections import Counter
from copy import deepcopy
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.clone_kernels import expect, likeliest, share_out, track
from neurosnap.agent.clones import OPEN, VISITS, Map, Walk, _Places, find_map
from tests.support.aliased_worlds import ring, room
from tools.paper.worlds_as_tables import Stage

KINDS = st.lists(st.integers(-1, 1), min_size=1, max_size=5)
CHANCES = st.lists(st.sampled_from((0.1, 0.4, 1.0)), min_size=8, max_size=8)


def chance(kinds: list[int], leads: NDArray[np.float64], way: tuple[int, ...]) -> float:
    """Return the chance of a way through two clones, and of all that was read on it."""
    whole = 0.5
    for kind, (before, after) in zip(kinds, pairwise(way), strict=True):
        whole *= 0.5 if kind < 0 else float(leads[kind, before, after])
    return whole


@given(KINDS, CHANCES)
def test_what_is_expected_and_likeliest_is_so_of_all_ways_there_are(
    kinds: list[int], drawn: list[float]
) -> None:
    leads = np.empty((2, 2, 2))
    share_out(np.array(drawn).reshape(2, 2, 2), np.zeros(2, np.int64), leads)
    assert np.allclose(leads.sum(axis=(0, 2)), 1)
    counts, ahead = np.empty_like(leads), np.empty((len(kinds) + 1, 2))
    told = expect(np.array(kinds), leads, ahead, counts, 0.25)
    ways = {
        way: chance(kinds, leads, way)
        for way in product(range(2), repeat=len(kinds) + 1)
    }
    whole, wanted = sum(ways.values()), np.full_like(leads, 0.25)
    for way, share in ways.items():
        for kind, (before, after) in zip(kinds, pairwise(way), strict=True):
            if kind >= 0:
                wanted[kind, before, after] += share / whole
    assert told == pytest.approx(np.log(whole))
    assert np.allclose(counts, wanted)
    best = tuple(likeliest(np.array(kinds), leads).tolist())
    assert ways[best] == pytest.approx(max(ways.values()))


@given(
    st.lists(st.integers(-1, 2), min_size=6, max_size=6),
    st.lists(
        st.tuples(st.integers(-1, 1), st.lists(st.booleans(), min_size=3, max_size=3)),
        max_size=6,
    ),
    st.lists(st.booleans(), min_size=3, max_size=3),
)
def test_it_may_be_wherever_what_was_read_allows(
    led: list[int], ticks: list[tuple[int, list[bool]]], before: list[bool]
) -> None:
    leads = np.array(led).reshape(2, 3)
    possible = np.zeros((len(ticks) + 1, 3), np.bool_)
    possible[0] = before
    fits = np.array([fit for _, fit in ticks], np.bool_).reshape(-1, 3)
    actions = np.array([action for action, _ in ticks], np.int64)
    lost = track(leads, actions, fits, possible)
    may = {k for k in range(3) if before[k]}
    for tick, (action, fit) in enumerate(ticks):
        here = {k for k in range(3) if fit[k]}
        after = set(leads[action, list(may)].tolist()) if action >= 0 else {-1}
        may = here if -1 in after else after & here
        assert lost[tick] == (not may and -1 not in after)
        may = may or here
        assert may == set(np.flatnonzero(possible[tick + 1]).tolist())


def walked(
    stage: Stage, ticks: int, seed: int = 0, ends: float = 0.0
) -> tuple[Walk, list[int]]:
    """Return what was read on a random walk, and where it was.

    With a chance of `ends` a step it ends, and another begins anywhere.
    """
    random = np.random.default_rng(seed)
    at, actions, place = [0], [-1], 0
    while len(at) < ticks:
        action = int(random.integers(len(stage.actions)))
        [(_, place)] = stage.outcomes[place][action]
        if random.random() < ends:
            action, place = -1, int(random.integers(len(stage.over)))
        at.append(place)
        actions.append(action)
    on = stage.fields.T[at].astype(np.bool_)
    return Walk(on, ~on, np.array(actions, np.int64)), at


def same_world(found: Map, stage: Stage, past: Walk, at: list[int]) -> bool:
    """Return whether a map is the world's, but for the names of its places."""
    possible, lost = found.follow(past)
    sure = possible.sum(axis=1) == 1
    met = {
        *zip(np.array(at)[sure].tolist(), possible[sure].argmax(axis=1), strict=True)
    }
    places = len({*at})
    return lost == 0 and len(met) == places == len(found.looks)


@pytest.mark.parametrize(
    ("stage", "ticks"), [(ring(6, (0,)), 300), (ring(12, (0, 4, 7)), 400)]
)
def test_a_map_of_a_ring_has_each_of_its_places_once(stage: Stage, ticks: int) -> None:
    past, at = walked(stage, ticks)
    found, left_open = find_map(past, 2, attempt=0)
    assert left_open < OPEN
    assert found is not None
    assert found.is_whole
    assert same_world(found, stage, past, at)


def test_a_room_of_four_colours_is_told_apart_and_later_walks_are_foretold() -> None:
    stage = room(4, 5, seed=1)
    past, at = walked(stage, 3000)
    maps = (find_map(past, 4, attempt)[0] for attempt in range(4))
    found = next(one for one in maps if one is not None)
    assert same_world(found, stage, past, at)
    assert found.follow(walked(stage, 1000, seed=7)[0])[1] == 0


def test_readings_that_are_unknown_and_trajectories_that_end_are_passed_over() -> None:
    stage = room(3, 3, seed=5)  # where nothing is on, nothing was read
    walk, at = walked(stage, 3000, ends=0.03)
    gone = np.random.default_rng(3).random(3000) < 0.03
    walk.on[gone] = walk.off[gone] = False
    maps = (find_map(walk, 4, attempt)[0] for attempt in range(4))
    found = next(one for one in maps if one is not None)
    assert same_world(found, stage, walk, at)


def test_a_map_is_whole_where_each_action_is_known_wherever_one_was_taken() -> None:
    def whole(*leads: list[int]) -> bool:
        return Map(np.zeros((3, 1), np.bool_), np.array(leads)).is_whole

    assert whole([1, 2, 0], [0, 0, 0])
    assert whole([1, 2, -1], [0, 0, -1])
    assert not whole([1, 2, -1], [0, 0, 0])


def test_where_chance_decides_there_is_no_map() -> None:
    random = np.random.default_rng(0)
    on = random.integers(0, 2, (500, 1)).astype(np.bool_)
    past = Walk(on, ~on, random.integers(0, 2, 500))
    found, left_open = find_map(past, 2, attempt=0)
    assert found is None
    assert left_open > 5 * OPEN
    few = Walk(on[:8], ~on[:8], past.actions[:8])
    alike = Walk(np.ones_like(on), np.zeros_like(on), past.actions)
    for walk in few, alike:  # nothing is known, or nothing is to be told apart
        assert find_map(walk, 2, attempt=0) == (None, np.inf)


@given(
    st.lists(st.integers(0, 2), min_size=6, max_size=6),
    st.lists(st.integers(0, 1), min_size=3, max_size=3),
    st.lists(st.integers(0, 1), min_size=20, max_size=60),
    st.lists(st.integers(0, 59), min_size=2, max_size=8),
)
def test_ticks_at_one_place_are_one_and_those_that_look_apart_never(
    led: list[int], looks: list[int], actions: list[int], wrong: list[int]
) -> None:
    """An automaton of three states; taking any ticks for one undoes what cannot be."""
    at = [0]
    for action in actions:
        at.append(led[3 * action + at[-1]])
    read = [looks[state] for state in at]
    places = _Places(read, actions)
    for one, other in pairwise(tick % len(at) for tick in wrong):
        before = deepcopy(vars(places))
        if not places._join(one, other):
            assert vars(places) == before
        assert all(
            read[a] == read[b]
            for a, b in product(range(len(at)), repeat=2)
            if places._find(a) == places._find(b)
        )
    right = _Places(read, actions)
    assert right.take_for_one(np.array(at), np.ones(len(at), np.bool_))
    assert len({right._find(tick) for tick in range(len(at))}) == len({*at})
    rows = np.array([[False], [True]])
    found = right.as_map(rows, 2)
    often = [state for state, times in Counter(at).items() if times >= VISITS]
    assert (found is None) or 2 <= len(found.looks) <= len(often)
