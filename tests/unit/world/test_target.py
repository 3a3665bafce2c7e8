"""Targets: distances match brute force, and two sensors report their changes."""

from collections import deque
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from world.grid import GridWorld
from world.path_and_cycle import CycleWorld, PathWorld, RandomFieldsWorld
from world.places import PlacesWorld
from world.worlds_with_targets import Target, distances_to

WORLDS = [
    lambda: PathWorld(places=9, wait=True),
    lambda: CycleWorld(places=8),
    lambda: GridWorld(width=4, height=3, wait=True),
    lambda: GridWorld(width=5, height=4, hole="middle"),
    lambda: RandomFieldsWorld(places=6, sensors=3),
]


class Slide(PlacesWorld):
    """0 → 1 → 2 → 2, one way only; 3 stays apart from all of them."""

    def __init__(self) -> None:
        super().__init__(
            sensors=("low",),
            actions=("slide", "jump"),
            moves=np.array([[1, 2, 2, 3], [0, 0, 2, 3]]),
            fields=np.array([[True, True, False, False]]),
            wait=False,
        )


def fewest_actions(moves: NDArray[np.intp], target: int) -> list[float]:
    """One breadth-first search forwards from each place, as slowly as can be."""
    found = []
    for start in range(moves.shape[1]):
        depth = {start: 0}
        queue = deque([start])
        while queue:
            here = queue.popleft()
            for there in moves[:, here].tolist():
                if there not in depth:
                    depth[there] = depth[here] + 1
                    queue.append(there)
        found.append(depth.get(target, float("inf")))
    return found


@st.composite
def any_moves(draw: st.DrawFn) -> NDArray[np.intp]:
    places = draw(st.integers(1, 8))
    row = st.lists(st.integers(0, places - 1), min_size=places, max_size=places)
    return np.array(draw(st.lists(row, min_size=1, max_size=3)))


@given(any_moves(), st.data())
def test_distances_are_the_fewest_actions_whatever_the_moves(
    moves: NDArray[np.intp], data: st.DataObject
) -> None:
    places = moves.shape[1]
    wanted = data.draw(st.sets(st.integers(0, places - 1)))
    aims = np.isin(np.arange(places), sorted(wanted))
    apart = [fewest_actions(moves, target) for target in sorted(wanted)]
    nearest = [min(each) for each in zip(*apart, strict=True)]
    expected = nearest if wanted else [float("inf")] * places
    assert distances_to(moves, aims).tolist() == expected


@pytest.mark.parametrize("make", WORLDS)
@pytest.mark.parametrize("target", [None, 2])
def test_better_and_worse_tell_how_the_distance_changed(
    make: Any, target: int | None
) -> None:
    world = make()
    env = Target(world, target)
    actions = np.random.default_rng(4).integers(len(world.moves), size=(5, 80))
    seen: set[tuple[int, ...]] = set()
    for run in actions:
        observation, info = env.reset(seed=None if seen else 4)
        assert observation[-2:].tolist() == [0, 0]
        distances = fewest_actions(world.moves, info["target"])
        before = info["distance"]
        assert before == distances[info["place"]]
        for action in run:
            observation, _, _, _, info = env.step(action)
            now = distances[info["place"]]
            scent = tuple(observation[-2:].tolist())
            assert scent == (now < before, now > before)
            assert info["distance"] == now
            seen.add(scent)
            before = now
    assert {(1, 0), (0, 1)} <= seen


def test_leaving_for_good_is_for_the_worse_and_wandering_there_is_neither() -> None:
    env, inf = Target(Slide(), 0), float("inf")
    assert env.distances.tolist() == [0, 1, inf, inf]  # one way, as the moves go
    env.reset(seed=0)
    while env.reset()[1]["place"] != 1:
        pass
    for scent in ([0, 1], [0, 0]):
        observation, _, _, _, info = env.step(np.int64(0))
        assert observation[-2:].tolist() == scent
        assert info["distance"] == inf


def test_a_drawn_target_is_drawn_after_the_start_from_the_same_numbers() -> None:
    env, bare, given = Target(PathWorld()), PathWorld(), Target(PathWorld(), 5)
    targets = set()
    for seed in (5, *[None] * 300):
        _, info = env.reset(seed=seed)
        _, expected = bare.reset(seed=seed)
        assert info["place"] == expected["place"]
        assert info["target"] == env.target == bare.np_random.integers(21)
        assert given.reset(seed=seed)[1]["target"] == 5
        targets.add(info["target"])
    assert targets == set(range(21))


def test_a_step_and_a_target_that_is_to_be_drawn_need_a_reset() -> None:
    env, given = Target(PathWorld()), Target(PathWorld(places=3), 2)
    assert given.target == 2
    assert given.distances.tolist() == [2, 1, 0]
    with pytest.raises(ValueError, match="read-only"):
        given.distances[0] = 1
    with pytest.raises(ResetNeeded, match=r"^target: "):
        _ = env.target
    with pytest.raises(ResetNeeded, match=r"^distances: "):
        _ = env.distances
    for one in (env, given):
        with pytest.raises(ResetNeeded):
            one.step(np.int64(0))


@pytest.mark.parametrize(
    "env",
    [
        None,
        "neurosnap/Path-v0",
        gymnasium.make("CartPole-v1"),
        Target(PathWorld(), 3),
        gymnasium.wrappers.TransformAction(
            PathWorld(), lambda action: action, gymnasium.spaces.Discrete(1)
        ),
    ],
)
def test_what_is_no_world_or_shows_it_otherwise_is_refused(env: Any) -> None:
    with pytest.raises(InvalidValueError, match=r"^env: must be a World, .*, got "):
        Target(env, 0)
