"""One suite for every world: Gymnasium's contract, and fields that tell the truth."""

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
from tests.support.worlds import IDS, NAMED, SHAPES, make, rollout, started
from world.implications import implications


@pytest.mark.parametrize(("name", "arguments"), NAMED)
def test_gymnasium_has_nothing_to_complain_about(
    name: str, arguments: dict[str, Any]
) -> None:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        check_env(gymnasium.make(name, **arguments).unwrapped)
    assert [str(warning.message) for warning in seen] == []


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
def test_starts_differ_and_cover_the_places(name: str) -> None:
    env = started(name)
    starts = {env.reset()[1]["place"] for _ in range(2000)}
    assert starts == set(range(env.fields.shape[1]))


@pytest.mark.parametrize("name", IDS)
def test_every_place_can_be_reached_from_every_other_and_back(name: str) -> None:
    # The paper's convergence needs the walk's moves reversible and the space connected.
    moves = make(name).moves
    joined = {(p, int(q)) for row in moves for p, q in enumerate(row)}
    assert joined == {(q, p) for p, q in joined}
    reached, frontier = {0}, {0}
    while frontier:
        frontier = {q for p, q in joined if p in frontier} - reached
        reached |= frontier
    assert reached == set(range(moves.shape[1]))


@pytest.mark.parametrize(("name", "arguments"), NAMED)
def test_implications_are_those_found_by_looking_at_every_place(
    name: str, arguments: dict[str, Any]
) -> None:
    env = started(name, **arguments)
    where = {}
    for sensor, field in zip(env.sensors, env.fields, strict=True):
        where[sensor] = {p for p, on in enumerate(field) if on}
        where[f"{sensor}*"] = {p for p, on in enumerate(field) if not on}
    expected = [
        (a, b)
        for a, b in itertools.product(where, repeat=2)
        if a.removesuffix("*") != b.removesuffix("*") and where[a] <= where[b]
    ]
    assert env.implications == expected


def test_empty_full_and_equal_fields_count() -> None:
    never, always = [False, False, False], [True, True, True]
    fields = np.array([never, always, [True, False, False], [True, False, False]])
    found = set(implications(("never", "always", "p", "q"), fields))
    assert {("never", "p"), ("never", "p*"), ("p", "always"), ("p*", "always")} <= found
    assert {("always", "never*"), ("always*", "p"), ("p", "never*")} <= found
    assert {("p", "q"), ("q", "p"), ("p*", "q*"), ("q*", "p*")} <= found
    assert ("p", "never") not in found
    assert ("p", "q*") not in found
    assert ("never", "never*") not in found  # of one sensor: not a proper pair


def test_the_path_is_one_chain() -> None:
    env = make("neurosnap/Path-v0", places=4)
    np.testing.assert_array_equal(
        env.fields, [[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0]]
    )
    assert env.implications == [
        ("below_1", "below_2"),
        ("below_1", "below_3"),
        ("below_2", "below_3"),
        ("below_2*", "below_1*"),
        ("below_3*", "below_1*"),
        ("below_3*", "below_2*"),
    ]


def test_the_path_stops_at_its_ends_and_the_cycle_goes_around() -> None:
    path, cycle = (make(f"neurosnap/{kind}-v0", places=4) for kind in ("Path", "Cycle"))
    assert path.moves.tolist() == [[1, 2, 3, 3], [0, 0, 1, 2]]
    assert cycle.moves.tolist() == [[1, 2, 3, 0], [3, 0, 1, 2]]


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
    assert [on[f"x_below_{k}"] for k in range(1, 11)] == [
        info["x"] < k for k in range(1, 11)
    ]
    assert [on[f"y_below_{k}"] for k in range(1, 11)] == [
        info["y"] < k for k in range(1, 11)
    ]


def test_random_fields_are_a_function_of_the_seed_of_the_reset() -> None:
    env = started("neurosnap/RandomFields-v0", seed=1)
    first = env.fields
    env.reset()
    np.testing.assert_array_equal(env.fields, first)
    env.reset(seed=2)
    assert (env.fields != first).any()
    env.reset(seed=1)
    np.testing.assert_array_equal(env.fields, first)


def test_random_fields_are_drawn_by_an_unseeded_first_reset_too() -> None:
    env = make("neurosnap/RandomFields-v0", places=50, sensors=50)
    env.reset()
    first = env.fields
    env.reset()
    np.testing.assert_array_equal(env.fields, first)
    assert 0.4 < first.mean() < 0.6  # all subsets alike: half of all is on


def test_random_fields_do_not_exist_before_a_reset() -> None:
    env = make("neurosnap/RandomFields-v0")
    with pytest.raises(ResetNeeded, match=r"^fields: "):
        _ = env.fields
    with pytest.raises(ResetNeeded, match=r"^fields: "):
        _ = env.implications


def test_a_step_needs_a_reset() -> None:
    with pytest.raises(ResetNeeded):
        make("neurosnap/Path-v0").step(0)


@pytest.mark.parametrize("action", [-1, 2, 1.0, "0", None])
def test_an_unknown_action_is_refused_and_moves_nothing(action: Any) -> None:
    env, twin = started("neurosnap/Path-v0"), started("neurosnap/Path-v0")
    with pytest.raises(InvalidValueError, match=r"^action: must be .*, got "):
        env.step(action)
    np.testing.assert_array_equal(env.step(0)[0], twin.step(0)[0])


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
        ("neurosnap/Path-v0", "target", "3"),
        ("neurosnap/PuncturedGrid-v0", "target", 120),
    ],
)
def test_a_bad_argument_is_named(name: str, argument: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=rf"^{argument}: must be .*, got "):
        gymnasium.make(name, **{argument: value})


def test_the_truth_cannot_be_written_to() -> None:
    for name in IDS:
        env = started(name)
        with pytest.raises(ValueError, match="read-only"):
            env.fields[0, 0] = True
        with pytest.raises(ValueError, match="read-only"):
            env.moves[0, 0] = 0


@pytest.mark.parametrize("name", IDS)
def test_worlds_state_their_contract(name: str) -> None:
    headings = "Description Sensors Actions Start Reward End Info Arguments References Versions"
    doc = type(make(name)).__doc__
    assert doc is not None
    at = [doc.find(f"    {heading}:\n") for heading in headings.split()]
    assert at == sorted(at)
    assert at[0] > 0


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


def test_actions_are_named_in_the_order_of_their_numbers() -> None:
    for kind in ("Path", "Cycle", "RandomFields"):
        assert make(f"neurosnap/{kind}-v0").actions == ("forward", "back")
    for kind in ("Grid", "PuncturedGrid"):
        named = make(f"neurosnap/{kind}-v0").actions
        assert named == ("up", "down", "left", "right")
    assert make("neurosnap/Rail-v0").actions == ("forward", "back", "wait")
