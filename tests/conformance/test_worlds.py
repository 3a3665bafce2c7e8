"""Every world keeps Gymnasium's contract, and its sensors are on where they must."""

import importlib
import itertools
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Discrete, MultiBinary
from gymnasium.utils.env_checker import check_env

import world
from neurosnap.errors import InvalidValueError
from world.places import PlacesWorld
from world.worlds_with_targets import Target

KINDS = ("Path", "Cycle", "Grid", "RandomFields", "PuncturedGrid", "Rail")
IDS = [f"neurosnap/{name}-v0" for name in KINDS]


# id, arguments, sensors, actions, places
SHAPES: list[tuple[str, dict[str, Any], int, int, int]] = [
    ("neurosnap/Path-v0", {}, 20, 2, 21),
    ("neurosnap/Path-v0", {"places": 2}, 1, 2, 2),
    ("neurosnap/Cycle-v0", {}, 20, 2, 20),
    ("neurosnap/Cycle-v0", {"places": 4}, 4, 2, 4),
    ("neurosnap/Grid-v0", {}, 20, 4, 121),
    ("neurosnap/Grid-v0", {"width": 3, "height": 5}, 6, 4, 15),
    ("neurosnap/RandomFields-v0", {}, 20, 2, 21),
    ("neurosnap/RandomFields-v0", {"places": 3, "sensors": 30}, 30, 2, 3),
    ("neurosnap/PuncturedGrid-v0", {}, 20, 4, 120),
    ("neurosnap/PuncturedGrid-v0", {"width": 3, "height": 3}, 4, 4, 8),
    ("neurosnap/PuncturedGrid-v0", {"width": 5, "height": 4, "hole": (3, 1)}, 7, 4, 19),
    ("neurosnap/Rail-v0", {}, 24, 3, 24),
    ("neurosnap/Rail-v0", {"wait": False}, 24, 2, 24),
    ("neurosnap/Cycle-v0", {"wait": True, "places": 7}, 7, 3, 7),
    ("neurosnap/PuncturedGrid-v0", {"wait": True}, 20, 5, 120),
]

NAMED = [(name, arguments) for name, arguments, *_ in SHAPES]


# A target at the place with the highest number, at the lowest, and drawn; sizes too.
TARGETS: list[tuple[str, dict[str, Any]]] = [
    *((name, {"target": 0}) for name in IDS),
    *((name, {"target": "drawn"}) for name in IDS),
    ("neurosnap/Path-v0", {"target": 4, "places": 5, "wait": False}),
    ("neurosnap/Cycle-v0", {"target": 5, "places": 6, "wait": False}),
    ("neurosnap/Grid-v0", {"target": 14, "width": 3, "height": 5}),
    ("neurosnap/RandomFields-v0", {"target": "drawn", "places": 3, "sensors": 30}),
    ("neurosnap/PuncturedGrid-v0", {"target": 7, "width": 3, "height": 3}),
    ("neurosnap/Rail-v0", {"target": 23}),
]


def aimed(name: str, **arguments: Any) -> Target:
    env = gymnasium.make(name, **arguments)
    while not isinstance(env, Target):
        assert isinstance(env, gymnasium.Wrapper)
        env = env.env
    return env


def make(name: str, **arguments: Any) -> PlacesWorld:
    env = gymnasium.make(name, **arguments).unwrapped
    assert isinstance(env, PlacesWorld)
    return env


def started(name: str, seed: int = 7, **arguments: Any) -> PlacesWorld:
    env = make(name, **arguments)
    env.reset(seed=seed)
    return env


def rollout(
    env: PlacesWorld | Target, seed: int, steps: int = 200
) -> tuple[np.ndarray[Any, Any], list[int]]:
    moves = env.get_wrapper_attr("moves")
    actions = np.random.default_rng(seed).integers(len(moves), size=steps)
    observation, info = env.reset(seed=seed)
    observations, places = [observation], [info["place"]]
    for action in actions:
        observation, _, _, _, info = env.step(action)
        observations.append(observation)
        places.append(info["place"])
    return np.array(observations), places


@pytest.mark.parametrize(("name", "arguments"), [*NAMED, *TARGETS])
def test_gymnasium_complains_of_a_target_only_and_only_that_it_is_a_wrapper(
    name: str, arguments: dict[str, Any]
) -> None:
    aims = "target" in arguments
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        check_env(aimed(name, **arguments) if aims else make(name, **arguments))
    assert len(seen) == aims
    assert all(
        "is different from the unwrapped" in str(warning.message) for warning in seen
    )


@pytest.mark.parametrize(("name", "arguments", "sensors", "actions", "places"), SHAPES)
def test_sizes_are_as_asked_for(
    name: str, arguments: dict[str, Any], sensors: int, actions: int, places: int
) -> None:
    env = started(name, **arguments)
    assert env.observation_space == MultiBinary(sensors)
    assert env.action_space == Discrete(actions)
    assert len(env.sensors) == sensors
    assert env.fields.shape == (sensors, places)
    assert env.fields.dtype == np.bool_
    assert env.moves.shape == (actions, places)
    assert len(env.actions) == actions
    assert env.orders == (0,) * sensors
    for names in (env.sensors, env.actions):
        assert len(set(names)) == len(names)
        assert all(name.isidentifier() for name in names)  # the star is for complements


@pytest.mark.parametrize(("name", "arguments"), NAMED)
def test_a_walk_follows_from_seed_and_actions_and_shows_the_fields(
    name: str, arguments: dict[str, Any]
) -> None:
    first, places = rollout(make(name, **arguments), seed=3)
    env = make(name, **arguments)
    rollout(env, seed=4)  # what happened before the seed must not matter
    again, places_again = rollout(env, seed=3)
    np.testing.assert_array_equal(first, again)
    assert first.dtype == again.dtype == np.int8
    assert places == places_again
    np.testing.assert_array_equal(first, env.fields[:, places].T)


@pytest.mark.parametrize("name", IDS)
def test_every_place_can_be_reached_from_every_other_and_back(name: str) -> None:
    # The paper's convergence needs the walk's moves reversible and the space connected.
    env = started(name)
    joined = {(p, int(q)) for row in env.moves for p, q in enumerate(row)}
    assert joined == {(q, p) for p, q in joined}
    reached, frontier = {0}, {0}
    while frontier:
        frontier = {q for p, q in joined if p in frontier} - reached
        reached |= frontier
    assert reached == set(range(env.moves.shape[1]))
    # Starts differ and cover the places.
    assert {env.reset()[1]["place"] for _ in range(2000)} == reached
    # The truth cannot be written to.
    for array in (env.fields, env.moves):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1


@pytest.mark.parametrize(("name", "arguments"), NAMED)
def test_implications_are_those_found_by_looking_at_every_place(
    name: str, arguments: dict[str, Any]
) -> None:
    env = started(name, **arguments)
    where = {}
    for sensor, field in zip(env.sensors, env.fields, strict=True):
        where[sensor] = {p for p, on in enumerate(field) if on}
        where[f"{sensor}*"] = {p for p, on in enumerate(field) if not on}
    assert env.implications == [
        (a, b)
        for a, b in itertools.product(where, repeat=2)
        if a.removesuffix("*") != b.removesuffix("*") and where[a] <= where[b]
    ]


def test_the_path_stops_at_its_ends_and_the_cycle_goes_around() -> None:
    path, cycle = (make(f"neurosnap/{kind}-v0", places=4) for kind in ("Path", "Cycle"))
    assert path.fields.tolist() == [[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0]]
    assert path.moves.tolist() == [[1, 2, 3, 3], [0, 0, 1, 2]]
    assert cycle.moves.tolist() == [[1, 2, 3, 0], [3, 0, 1, 2]]
    assert path.actions == cycle.actions == ("forward", "back")


def test_far_beacons_of_the_default_cycle_exclude_each_other_and_no_more() -> None:
    env = make("neurosnap/Cycle-v0")
    assert set(env.implications) == {
        (f"near_{i}", f"near_{j}*")
        for i in range(20)
        for j in range(20)
        if 3 <= (i - j) % 20 <= 17
    }


@pytest.mark.parametrize("name", ["neurosnap/Grid-v0", "neurosnap/PuncturedGrid-v0"])
def test_the_grid_is_two_chains_with_nothing_between_hole_or_no_hole(name: str) -> None:
    env = make(name)
    assert all(a[0] == b[0] for a, b in env.implications)
    assert len(env.implications) == 2 * (10 * 9)
    observation, info = env.reset(seed=1)
    on = dict(zip(env.sensors, observation, strict=True))
    for axis, k in itertools.product("xy", range(1, 11)):
        assert on[f"{axis}_below_{k}"] == (info[axis] < k)
    assert env.actions == ("up", "down", "left", "right")


def test_random_fields_are_a_function_of_the_seed_of_the_reset() -> None:
    env = make("neurosnap/RandomFields-v0")
    for unread in (lambda: env.fields, lambda: env.implications):
        with pytest.raises(ResetNeeded, match=r"^fields: "):
            unread()
    env.reset(seed=1)
    first = env.fields
    env.reset()
    np.testing.assert_array_equal(env.fields, first)
    env.reset(seed=2)
    assert (env.fields != first).any()
    env.reset(seed=1)
    np.testing.assert_array_equal(env.fields, first)
    unseeded = make("neurosnap/RandomFields-v0", places=50, sensors=50)
    unseeded.reset()
    first = unseeded.fields
    unseeded.reset()
    np.testing.assert_array_equal(unseeded.fields, first)
    assert 0.4 < first.mean() < 0.6  # all subsets alike: half of all is on


@pytest.mark.parametrize("action", [-1, 2, 1.0, "0", None])
def test_an_unknown_action_is_refused_and_moves_nothing(action: Any) -> None:
    env, twin = started("neurosnap/Path-v0"), make("neurosnap/Path-v0")
    with pytest.raises(ResetNeeded):
        twin.step(0)
    twin.reset(seed=7)
    with pytest.raises(InvalidValueError, match=r"^action: must be .*, got "):
        env.step(action)
    np.testing.assert_array_equal(env.step(0)[0], twin.step(0)[0])


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("neurosnap/Path-v0", {"places": 10**14}),
        ("neurosnap/Cycle-v0", {"places": 10**7}),
        ("neurosnap/Grid-v0", {"width": 10**5, "height": 10**5}),
        ("neurosnap/RandomFields-v0", {"sensors": 20, "places": 10**13}),
    ],
)
def test_a_world_too_large_for_the_memory_is_refused_before_it_is_made(
    name: str, arguments: dict[str, Any]
) -> None:
    rule = r"(takes about|for every pair are) [\d,.]+ GB, free are [\d.]+ GB"
    with pytest.raises(InvalidValueError, match=rule):
        make(name, **arguments)


@pytest.mark.parametrize(
    ("name", "argument", "value"),
    [
        ("neurosnap/Path-v0", "places", 1),
        ("neurosnap/Path-v0", "places", 2.5),
        ("neurosnap/Path-v0", "places", True),
        ("neurosnap/Path-v0", "places", "21"),
        ("neurosnap/Cycle-v0", "places", 3),
        ("neurosnap/Grid-v0", "width", 1),
        ("neurosnap/Grid-v0", "height", 0),
        ("neurosnap/RandomFields-v0", "places", 1),
        ("neurosnap/RandomFields-v0", "sensors", 0),
        ("neurosnap/RandomFields-v0", "sensors", None),
        ("neurosnap/PuncturedGrid-v0", "width", 2),
        ("neurosnap/PuncturedGrid-v0", "height", 2),
        *(
            ("neurosnap/PuncturedGrid-v0", "hole", hole)
            for hole in [(0, 5), (5, 10), (-1, 5), (5,), (1, 2, 3), (1.0, 2), (), 5]
        ),
        ("neurosnap/Path-v0", "wait", 1),
        ("neurosnap/Grid-v0", "wait", "no"),
        ("neurosnap/Path-v0", "target", 21),
        ("neurosnap/Path-v0", "target", -1),
        ("neurosnap/Path-v0", "target", 3.0),
        ("neurosnap/Path-v0", "target", True),
        ("neurosnap/Path-v0", "target", (1,)),
        ("neurosnap/Path-v0", "target", "3"),
        ("neurosnap/PuncturedGrid-v0", "target", 120),
    ],
)
def test_a_bad_argument_is_named(name: str, argument: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=rf"^{argument}: must be .*, got "):
        gymnasium.make(name, **{argument: value})


def test_importing_again_registers_nothing_twice() -> None:
    before = {name: gymnasium.spec(name) for name in IDS}
    importlib.reload(world)  # a second registration would warn, and so fail
    assert {name: gymnasium.spec(name) for name in IDS} == before


@pytest.mark.parametrize("name", IDS)
def test_waiting_is_the_last_action_and_changes_nothing_else(name: str) -> None:
    bare, env = make(name, wait=False), make(name, wait=True)
    assert env.actions == (*bare.actions, "wait")
    np.testing.assert_array_equal(env.moves[:-1], bare.moves)
    np.testing.assert_array_equal(env.moves[-1], np.arange(bare.moves.shape[1]))
    for one in (bare, env):
        one.reset(seed=7)
    np.testing.assert_array_equal(env.fields, bare.fields)
    for _ in range(20):
        assert env.reset()[1] == bare.reset()[1]


# With a target ------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "arguments"), TARGETS)
def test_a_target_leaves_the_world_as_it_is(
    name: str, arguments: dict[str, Any]
) -> None:
    env = aimed(name, **arguments)
    bare = make(name, **{"wait": True, **arguments, "target": None})
    assert bare.actions == env.get_wrapper_attr("actions")
    expected, places = rollout(bare, seed=8)
    observations, places_again = rollout(env, seed=8)
    assert places_again == places
    np.testing.assert_array_equal(observations[:, :-2], expected)
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
    count, places = len(world.sensors), world.moves.shape[1]
    assert env.observation_space == MultiBinary(count + 2)
    assert env.action_space == Discrete(len(world.actions))
    said = env.get_wrapper_attr
    assert said("sensors") == (*world.sensors, "better", "worse")
    assert said("orders") == (0,) * count + (1, 1)
    assert said("actions") == world.actions
    assert said("moves") is world.moves
    assert said("fields") is world.fields
    assert said("distances").shape == (places,)
    assert 0 <= said("target") < places
    # It is made again from its spec.
    assert env.spec is not None
    again = gymnasium.make(env.spec)
    assert str(again) == str(env)
    again.reset(seed=2)
    assert again.get_wrapper_attr("target") == said("target")
    spec = Target(gymnasium.make(name, **{**arguments, "target": None}), 1).spec
    assert spec is not None
    assert gymnasium.make(spec).get_wrapper_attr("target") == 1


def test_a_world_without_a_target_is_bare_and_with_one_waits() -> None:
    for name in IDS:
        assert not gymnasium.make(name).has_wrapper_attr("distances")
        for wait, more in ((True, {}), (False, {"wait": False})):
            aiming = gymnasium.make(name, target=1, **more)
            assert ("wait" in aiming.get_wrapper_attr("actions")) == wait
