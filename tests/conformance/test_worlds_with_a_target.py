"""A target leaves its world as it is, and says where it is."""

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary
from gymnasium.utils.env_checker import check_env

from tests.support.worlds import IDS, TARGETS, aimed, make, rollout
from world.places import PlacesWorld
from world.target import Target


@pytest.mark.parametrize(("name", "arguments"), TARGETS)
def test_gymnasium_complains_of_a_target_only_that_it_is_a_wrapper(
    name: str, arguments: dict[str, Any]
) -> None:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        check_env(aimed(name, **arguments))
    (warning,) = seen
    assert "is different from the unwrapped version" in str(warning.message)


@pytest.mark.parametrize(("name", "arguments"), TARGETS)
def test_a_target_leaves_the_world_as_it_is(
    name: str, arguments: dict[str, Any]
) -> None:
    env = aimed(name, **arguments)
    bare = make(name, **{"wait": True, **arguments, "target": None})
    assert bare.actions == env.actions
    expected, places = rollout(bare, seed=8)
    observations, places_again = rollout(env, seed=8)
    assert places_again == places
    np.testing.assert_array_equal(observations[:, :-2], expected)
    np.testing.assert_array_equal(env.fields, bare.fields)
    np.testing.assert_array_equal(env.moves, bare.moves)
    assert env.implications == bare.implications
    again, places_again = rollout(env, seed=8)  # what came before must not matter
    np.testing.assert_array_equal(again, observations)
    assert (places_again, again.dtype) == (places, np.int8)


@pytest.mark.parametrize(("name", "arguments"), TARGETS)
def test_what_a_target_says_of_itself_is_reached_through_all_wrappers(
    name: str, arguments: dict[str, Any]
) -> None:
    env = gymnasium.make(name, **arguments)
    env.reset(seed=2)
    world = env.unwrapped
    assert isinstance(world, PlacesWorld)
    count = len(world.sensors)
    assert env.observation_space == MultiBinary(count + 2)
    assert env.action_space == Discrete(len(world.actions))
    assert env.get_wrapper_attr("sensors") == (*world.sensors, "better", "worse")
    assert env.get_wrapper_attr("orders") == (0,) * count + (1, 1)
    assert env.get_wrapper_attr("actions") == world.actions
    assert env.get_wrapper_attr("moves") is world.moves
    assert env.get_wrapper_attr("fields") is world.fields
    places = world.moves.shape[1]
    assert env.get_wrapper_attr("distances").shape == (places,)
    assert 0 <= env.get_wrapper_attr("target") < places


@pytest.mark.parametrize(("name", "arguments"), TARGETS)
def test_a_world_with_a_target_is_made_again_from_its_spec(
    name: str, arguments: dict[str, Any]
) -> None:
    env = gymnasium.make(name, **arguments)
    assert env.spec is not None
    again = gymnasium.make(env.spec)
    assert str(again) == str(env)
    for one in (env, again):
        one.reset(seed=6)
    assert again.get_wrapper_attr("target") == env.get_wrapper_attr("target")


def test_a_target_put_around_a_made_world_is_in_its_spec() -> None:
    spec = Target(gymnasium.make("neurosnap/Path-v0", places=6), 4).spec
    assert spec is not None
    assert gymnasium.make(spec).get_wrapper_attr("target") == 4


def test_a_world_without_a_target_is_bare_and_with_one_waits() -> None:
    for name in IDS:
        assert not gymnasium.make(name).has_wrapper_attr("distances")
        assert aimed(name, target=1).actions[-1] == "wait"
        assert "wait" not in aimed(name, target=1, wait=False).actions
