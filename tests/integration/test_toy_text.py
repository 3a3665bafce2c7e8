"""Worlds nobody made for us: their tables are right, and an agent learns what is true.

What is true is found here a second time, by stepping Gymnasium's own environments from
every state there is.
"""

import asyncio
import functools
import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.envs.toy_text.taxi import TaxiEnv
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.body import Body, Senses
from neurosnap.agent.environment import describe
from neurosnap.agent.policies import new_policy
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.sensor import Sensor, decreased, increased, one_hot
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.run import run
from neurosnap.sensorium import Sensorium, complete, unpack
from neurosnap.sources.gymnasium_source import Continuing
from neurosnap.sources.open import open_source
from world.implications import (
    implications,
    inclusions,
    learn,
    rarest_pair,
    recordable,
)
from world.table import Table, state_fields, transition_fields
from world.toy_text import cliff_walking, frozen_lake, taxi

BEDS: list[Callable[..., BinarySensors]] = [frozen_lake, cliff_walking, taxi]
EXACT = [frozen_lake, cliff_walking]  # no chance in them, not even at a reset
VARIANTS: list[tuple[Callable[..., BinarySensors], dict[str, Any]]] = [
    (frozen_lake, {}),
    (frozen_lake, {"map_name": "8x8"}),
    (frozen_lake, {"is_slippery": True}),
    (cliff_walking, {}),
    (cliff_walking, {"is_slippery": True}),
    (taxi, {}),
    (taxi, {"is_rainy": True}),
]

Situation = tuple[int, bool]  # a state, and whether the episode is over there
Move = tuple[Situation, int, Situation]


def situations(table: Table) -> list[Situation]:
    return list(zip(table.states.tolist(), table.over.tolist(), strict=True))


def moves(table: Table) -> set[Move]:
    at = situations(table)
    rows = zip(
        table.before.tolist(), table.action.tolist(), table.after.tolist(), strict=True
    )
    return {(at[before], action, at[after]) for before, action, after in rows}


def explored(env: BinarySensors, tries: int) -> set[Move]:
    """Every move that turns up when each action is tried so often at each state."""
    inner: Any = env.unwrapped
    starts = {(int(inner.reset()[0]), False) for _ in range(5000)}
    found: set[Move] = set()
    seen, frontier = set(starts), set(starts)
    while frontier:
        place = frontier.pop()
        for action in range(inner.action_space.n):
            reached = set(starts)
            if not place[1]:
                reached = set()
                for _ in range(tries):
                    inner.s = place[0]
                    state, _, over, _, _ = inner.step(action)
                    reached.add((int(state), bool(over)))
            found |= {(place, action, after) for after in reached}
            frontier |= reached - seen
            seen |= reached
    return found


# The worlds ---------------------------------------------------------------------------


# The checker would rather see the environment within, which has no binary sensors.
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
@pytest.mark.parametrize("bed", BEDS)
def test_gymnasium_finds_nothing_wrong(bed: Callable[..., BinarySensors]) -> None:
    spec = EnvSpec(id="neurosnap/Bed-v0", entry_point=f"world.toy_text:{bed.__name__}")
    env = gymnasium.make(spec)
    check_env(env, skip_render_check=True)
    seen = describe("bed", env)
    assert seen.sensors == bed().sensors
    assert seen.orders == (0,) * len(seen.sensors)
    assert len(seen.actions) == env.action_space.n  # type: ignore[attr-defined]


def test_their_sensors() -> None:
    lake = ("row<1", "row<2", "row<3", "column<1", "column<2", "column<3")
    assert frozen_lake().sensors == (*lake, "tile=start", "tile=hole", "tile=goal")
    assert len(frozen_lake(map_name="8x8").sensors) == 17
    cliff = cliff_walking().sensors
    assert cliff[:4] == ("row<1", "row<2", "row<3", "column<1")
    assert cliff[13:] == ("column<11", "tile=start", "tile=goal")
    cab = taxi().sensors
    assert cab[3:5] == ("row<4", "column<1")
    assert cab[8:] == (
        *("passenger=red", "passenger=green", "passenger=yellow", "passenger=blue"),
        *("passenger=taxi", "destination=red", "destination=green"),
        *("destination=yellow", "destination=blue"),
    )


DIRECTIONS = {
    "left": (0, -1),
    "right": (0, 1),
    "up": (-1, 0),
    "down": (1, 0),
    "west": (0, -1),
    "east": (0, 1),
    "north": (-1, 0),
    "south": (1, 0),
}


@pytest.mark.parametrize("bed", BEDS)
def test_actions_are_called_what_they_do(bed: Callable[..., BinarySensors]) -> None:
    env = bed()
    inner: Any = env.unwrapped
    # In the open: row 2, column 1 of the lake; row 1, column 2; row 2, column 2.
    state = {frozen_lake: 9, cliff_walking: 14, taxi: 241}[bed]
    for action, name in enumerate(env.actions):
        if name in DIRECTIONS:
            env.reset(seed=0)
            inner.s = state
            before = env.state_of(inner.s, {})
            env.step(action)
            after = env.state_of(inner.s, {})
            moved = (after.row - before.row, after.column - before.column)
            assert moved == DIRECTIONS[name]


def test_a_taxi_picks_up_and_drops_off() -> None:
    env = taxi()
    inner: Any = env.unwrapped
    env.reset(seed=0)
    inner.s = inner.encode(0, 4, 1, 2)  # at green, where the passenger is
    env.step(env.actions.index("pickup"))
    assert env.state_of(inner.s, {}) == (0, 4, "taxi", "yellow")
    observation = env.step(env.actions.index("dropoff"))[0]
    assert env.state_of(inner.s, {}) == (0, 4, "green", "yellow")
    on = {name for name, bit in zip(env.sensors, observation, strict=True) if bit}
    rows = {"row<1", "row<2", "row<3", "row<4"}
    assert on == rows | {"passenger=green", "destination=yellow"}


# Their tables -------------------------------------------------------------------------


@pytest.mark.parametrize("bed", EXACT)
def test_a_walk_in_the_table_is_a_walk_in_the_environment(
    bed: Callable[..., BinarySensors],
) -> None:
    env = bed()
    inner: Any = env.unwrapped
    table = Table.of(env)
    fields = state_fields(env, table)
    places, actions = table.walk(5000, np.random.default_rng(3))
    observations, episode = [env.reset(seed=0)[0]], 0
    states = [inner.s]
    going_on = Continuing(env)
    for action in actions.tolist():
        observation, _, _, _, info = going_on.step(action)
        observations.append(observation)
        states.append(inner.s)
        episode = info["episode"]
    assert table.states[places].tolist() == states
    np.testing.assert_array_equal(fields[:, places].T, observations)
    assert episode == table.over[places[:-1]].sum()


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_steps_of_the_environment_are_in_the_table(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    env = bed(**arguments)
    inner: Any = env.unwrapped
    known = moves(Table.of(env))
    going_on = Continuing(env)
    going_on.reset(seed=1)
    place: Situation = (int(inner.s), False)
    for action in np.random.default_rng(2).integers(len(env.actions), size=4000):
        going_on.step(int(action))
        after: Situation = (int(inner.s), bool(going_on.autoreset))
        assert (place, int(action), after) in known
        place = after


@pytest.mark.slow
@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_the_table_is_what_trying_everything_finds(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    # With three outcomes of a tenth or more, 200 tries miss one in 1 of 10^9 cases.
    tries = 200 if arguments.keys() - {"map_name"} else 1
    env = bed(**arguments)
    env.unwrapped.reset(seed=0)
    assert moves(Table.of(env)) == explored(env, tries)


def test_the_sizes_are_those_of_gymnasiums_text() -> None:
    lake, cliff, cab = (Table.of(bed()) for bed in BEDS)
    assert (len(lake.states), lake.over.sum()) == (16, 5)
    # "3 x 12 + 1 possible states", and the goal.
    assert (len(cliff.states), cliff.over.sum()) == (38, 1)
    # "404 reachable discrete states", "300 possible initial states".
    assert (len(cab.states), cab.over.sum()) == (404, 4)
    np.testing.assert_allclose(cab.start[cab.start > 0], 1 / 300)
    assert (cab.start > 0).sum() == 300


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_chances_add_up(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    table = Table.of(bed(**arguments))
    total = np.zeros((len(table.states), table.actions))
    np.add.at(total, (table.before, table.action), table.chance)
    np.testing.assert_allclose(total, 1)
    assert table.start.sum() == pytest.approx(1)
    keys = list(zip(table.before, table.action, table.after, strict=True))
    assert keys == sorted(set(keys))


def test_outcomes_come_as_often_as_their_chance() -> None:
    table = Table.of(frozen_lake(is_slippery=True))
    places, actions = table.walk(100_000, np.random.default_rng(7))
    rows = zip(places[:-1].tolist(), actions.tolist(), places[1:].tolist(), strict=True)
    made = Counter(rows)
    tried = Counter(zip(places[:-1].tolist(), actions.tolist(), strict=True))
    keys = zip(
        table.before.tolist(), table.action.tolist(), table.after.tolist(), strict=True
    )
    for key, chance in zip(keys, table.chance.tolist(), strict=True):
        draws = tried[key[:2]]
        spread = (draws * chance * (1 - chance)) ** 0.5
        assert abs(made[key] - draws * chance) <= 6 * spread
    counts = np.bincount(actions, minlength=4)
    assert (abs(counts - 25_000) < 6 * (100_000 * 3 / 16) ** 0.5).all()


def test_a_walk_is_a_function_of_its_seed() -> None:
    table = Table.of(taxi())
    first, again, other = (
        table.walk(300, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert first[0].tolist() != other[0].tolist()


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_the_stationary_shares_stay_what_they_are(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    table = Table.of(bed(**arguments))
    shares = table.stationary()
    assert shares.sum() == pytest.approx(1)
    assert shares.min() > 0
    after = np.zeros_like(shares)
    for b, c, chance in zip(table.before, table.after, table.chance, strict=True):
        after[c] += shares[b] * chance / table.actions
    np.testing.assert_allclose(after, shares, atol=1e-12)


class Trap(gymnasium.Env[Any, Any]):
    """Two states with no way out, and a start between them."""

    def __init__(self) -> None:
        self.observation_space = self.action_space = gymnasium.spaces.Discrete(3)
        ways = [(0.5, 0, 0.0, False), (0.5, 2, 0.0, False), (0.0, 1, 0.0, False)]
        self.P = {
            0: {0: [(1.0, 0, 0.0, False)]},
            1: {0: ways},
            2: {0: [(1.0, 2, 0.0, False)]},
        }
        self.initial_state_distrib = np.array([0.0, 1.0, 0.0])


def test_shares_that_depend_on_where_the_walk_is_caught_are_refused() -> None:
    table = Table.of(Trap())
    assert moves(table) == {
        ((0, False), 0, (0, False)),
        ((1, False), 0, (0, False)),
        ((1, False), 0, (2, False)),
        ((2, False), 0, (2, False)),
    }
    with pytest.raises(
        InvalidValueError, match=r"^environment: must not catch the walk"
    ):
        table.stationary()


def test_an_environment_without_a_true_table_is_refused() -> None:
    rule = r"^environment: must have a transition table and a distribution of starts"
    with pytest.raises(InvalidValueError, match=rule):
        Table.of(gymnasium.make("CartPole-v1"))
    with pytest.raises(InvalidValueError, match=r"^environment: must have passengers"):
        Table.of(TaxiEnv(fickle_passenger=True))


# What is true -------------------------------------------------------------------------


def readings(bed: Callable[..., BinarySensors]) -> dict[str, set[int]]:
    """Where each sensor should be on among the states of the table, by arithmetic."""
    states = set(Table.of(bed()).states.tolist())
    if bed is taxi:
        stops = ["red", "green", "yellow", "blue", "taxi"]
        where = {s: (s // 100, s // 20 % 5, s // 4 % 5, s % 4) for s in states}
        return {
            **{f"row<{k}": {s for s in states if where[s][0] < k} for k in range(1, 5)},
            **{
                f"column<{k}": {s for s in states if where[s][1] < k}
                for k in range(1, 5)
            },
            **{
                f"passenger={stop}": {s for s in states if where[s][2] == k}
                for k, stop in enumerate(stops)
            },
            **{
                f"destination={stop}": {s for s in states if where[s][3] == k}
                for k, stop in enumerate(stops[:4])
            },
        }
    width = 4 if bed is frozen_lake else 12
    tiles = {"start": {0}, "hole": {5, 7, 11, 12}, "goal": {15}}
    if bed is cliff_walking:
        tiles = {"start": {36}, "goal": {47}}
    return {
        **{f"row<{k}": {s for s in states if s // width < k} for k in range(1, 4)},
        **{
            f"column<{k}": {s for s in states if s % width < k} for k in range(1, width)
        },
        **{f"tile={tile}": places for tile, places in tiles.items()},
    }


@pytest.mark.parametrize("bed", BEDS)
def test_fields_and_truths_are_those_of_plain_arithmetic(
    bed: Callable[..., BinarySensors],
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    expected = readings(bed)
    assert list(expected) == list(env.sensors)
    states = table.states.tolist()
    for name, field in zip(env.sensors, fields, strict=True):
        assert {states[k] for k in field.nonzero()[0]} == expected[name]
    everywhere = set(states)
    where = {}
    for name, on in expected.items():
        where[name], where[f"{name}*"] = on, everywhere - on
    truths = [
        (a, b)
        for a, b in itertools.product(where, repeat=2)
        if a.removesuffix("*") != b.removesuffix("*") and where[a] <= where[b]
    ]
    assert implications(env.sensors, fields) == truths


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_no_sensor_is_always_on_or_always_off(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    env = bed(**arguments)
    fields = state_fields(env, Table.of(env))
    assert fields.any(axis=1).all()
    assert not fields.all(axis=1).any()
    np.testing.assert_array_equal(recordable(fields), inclusions(fields))


def test_some_truths_in_words() -> None:
    def truths(env: BinarySensors) -> set[tuple[str, str]]:
        return set(implications(env.sensors, state_fields(env, Table.of(env))))

    lake = truths(frozen_lake())
    assert {("tile=goal", "row<3*"), ("tile=start", "column<1")} <= lake
    assert ("tile=hole", "row<1*") in lake
    assert ("tile=hole", "column<1*") not in lake  # there is one in the corner
    cliff = truths(cliff_walking())
    assert ("tile=goal", "row<3*") in cliff
    assert ("row<3*", "column<1") not in cliff  # the goal is in the bottom row, too
    cab = truths(taxi())
    assert ("passenger=taxi", "passenger=red*") in cab
    # Just delivered.
    assert ("passenger=red", "destination=red*") not in cab


def lake_with_changes() -> BinarySensors:
    """The lake with two sensors of order 1 among its own."""
    bare = frozen_lake()
    inner: Any = bare.unwrapped
    return BinarySensors(
        inner,
        [
            *one_hot("state", range(15)),
            increased("further"),
            decreased("back"),
        ],
        actions=bare.actions,
    )


@pytest.mark.parametrize("make", [frozen_lake, lake_with_changes])
def test_transitions_are_sensed_as_an_agent_senses_them(
    make: Callable[[], BinarySensors],
) -> None:
    env = make()
    table = Table.of(env)
    body = Body.full(env.sensors, env.actions, env.orders)
    senses = Senses(body)
    fields = transition_fields(env, table, body.context)
    assert fields.shape == (len(body.sensors), len(table.before))
    inner: Any = env.unwrapped
    column = {
        move: k for k, move in enumerate(zip(table.before, table.action, strict=True))
    }
    place = {state: k for k, state in enumerate(table.states.tolist())}
    going_on = Continuing(env)
    before = going_on.reset(seed=0)[0].astype(np.bool_)
    seen = set()
    for action in np.random.default_rng(0).integers(4, size=6000).tolist():
        k = column[(place[inner.s], action)]
        readings, _, _, _, info = going_on.step(action)
        after = readings.astype(np.bool_)
        assert info["begins"] == table.over[table.before[k]]
        taken = -1 if info["begins"] else action
        whole = senses.observe(after, taken, complete(before))
        np.testing.assert_array_equal(fields[:, k], whole)
        before = after
        seen.add(k)
    assert len(seen) == len(table.before)


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_the_steps_of_a_walk_are_found_among_the_transitions(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    table = Table.of(bed(**arguments))
    places, actions = table.walk(2000, np.random.default_rng(8))
    columns = table.columns(places, actions)
    np.testing.assert_array_equal(table.before[columns], places[:-1])
    np.testing.assert_array_equal(table.action[columns], actions)
    np.testing.assert_array_equal(table.after[columns], places[1:])


def test_what_an_action_leads_to_is_a_truth_about_transitions() -> None:
    env = frozen_lake()
    body = Body.full(env.sensors, env.actions, env.orders)
    fields = transition_fields(env, Table.of(env), body.context)
    truths = set(implications(body.sensors, fields))
    assert ("left&column<1", "column<1") in truths
    assert ("left&column<2", "column<1") in truths
    assert ("right&~column<1", "column<1*") in truths  # a reset is nobody's doing
    assert ("right&~column<1", "column<2*") in truths
    assert ("down&~row<2", "row<2*") in truths
    assert ("up", "down*") in truths
    # Whoever is in a hole, or at the goal, takes no action there.
    felt = (fields.sum(axis=1) > 0).tolist()
    never = {s for s, on in zip(body.sensors, felt, strict=True) if not on}
    assert never == {
        f"{action}&tile={tile}" for action in env.actions for tile in ("hole", "goal")
    }


def test_sensors_of_too_high_an_order_are_refused() -> None:
    env = lake_with_changes()
    table = Table.of(env)
    with pytest.raises(InvalidValueError, match=r"^sensor further: must be of order 0"):
        state_fields(env, table)
    with pytest.raises(
        InvalidValueError, match=r"^context: must be of literals of state"
    ):
        transition_fields(env, table, [(0, 30)])
    older = BinarySensors(env.unwrapped, [Sensor("old", lambda *_: True, order=2)])
    with pytest.raises(InvalidValueError, match=r"^sensor old: must be of order 1"):
        transition_fields(older, table)


# What is learned ----------------------------------------------------------------------

Fields = NDArray[np.bool_]


@st.composite
def all_fields(draw: st.DrawFn) -> Fields:
    places = draw(st.integers(1, 4))
    rows = st.lists(st.booleans(), min_size=places, max_size=places)
    return np.array(draw(st.lists(rows, min_size=1, max_size=6)), np.bool_)


@given(all_fields())
def test_what_can_be_recorded_is_what_is_recorded_after_seeing_everything(
    fields: Fields,
) -> None:
    places = fields.shape[1]
    snapshot = EmpiricalSnapshot(len(fields), 1 / (4 * places))
    for bits in fields.T:
        snapshot.learn(bits)
    np.testing.assert_array_equal(recordable(fields), snapshot.poc_graph().edges)


@given(all_fields())
def test_what_cannot_be_recorded_is_what_follows_from_nothing(fields: Fields) -> None:
    literals = [field for pair in fields for field in (pair, ~pair)]
    lacking = inclusions(fields) & ~recordable(fields)
    for a, b in itertools.product(range(len(literals)), repeat=2):
        low, high = literals[a], literals[b]
        trivial = not low.any() or bool(high.all())
        assert lacking[a, b] == (a >> 1 != b >> 1 and trivial and (low != high).any())


@given(all_fields())
def test_the_rarest_pair_is_the_least_weight_of_a_free_square(fields: Fields) -> None:
    shares = np.arange(1, fields.shape[1] + 1) / np.arange(1, fields.shape[1] + 1).sum()
    least = 1.0
    for one, two in itertools.combinations(fields, 2):
        square = [a & b for a in (one, ~one) for b in (two, ~two)]
        if all(cell.any() for cell in square):
            least = min(least, *(float(shares[cell].sum()) for cell in square))
    assert rarest_pair(fields, shares) == pytest.approx(least)


def test_errors_are_counted_at_every_step() -> None:
    env = frozen_lake()
    table = Table.of(env)
    fields = state_fields(env, table)
    truth = {
        (a, b)
        for a, b in itertools.product(range(18), repeat=2)
        if a >> 1 != b >> 1
        and not ((fields[a >> 1] ^ a & 1) & ~(fields[b >> 1] ^ b & 1)).any()
    }
    places, _ = table.walk(299, np.random.default_rng(4))
    snapshot = EmpiricalSnapshot(9, 0.001)
    expected = []
    for place in places:
        snapshot.observe(fields[:, place])
        edges = {(int(a), int(b)) for a, b in np.argwhere(snapshot.poc_graph().edges)}
        expected.append(len(edges ^ truth))
    assert learn(fields, places, 0.001).tolist() == expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("bed", "threshold", "steps"),
    [
        (frozen_lake, 1e-4, 10_000),
        (cliff_walking, 1e-5, 100_000),
        (taxi, 1e-5, 200_000),
    ],
)
def test_a_random_walk_learns_exactly_what_is_true(
    bed: Callable[..., BinarySensors], threshold: float, steps: int, seed: int
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    assert threshold < rarest_pair(fields, table.stationary())
    places, _ = table.walk(steps, np.random.default_rng(seed))
    errors = learn(fields, places, threshold)
    assert errors[0] > 0
    assert not errors[-steps // 5 :].any()


@pytest.mark.slow
@pytest.mark.parametrize("bed", BEDS)
def test_a_threshold_above_the_rarest_pair_keeps_something_false(
    bed: Callable[..., BinarySensors],
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    threshold = 3 * rarest_pair(fields, table.stationary())
    places, _ = table.walk(200_000, np.random.default_rng(0))
    assert learn(fields, places, threshold)[-50_000:].all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bed", "steps"), [(frozen_lake, 8000), (cliff_walking, 80_000)]
)
def test_a_random_walk_learns_exactly_what_its_actions_lead_to(
    bed: Callable[..., BinarySensors], steps: int
) -> None:
    env = bed()
    table = Table.of(env)
    body = Body.full(env.sensors, env.actions, env.orders)
    fields = transition_fields(env, table, body.context)
    chances = table.chance / table.actions * table.stationary()[table.before]
    assert chances.sum() == pytest.approx(1)
    assert THRESHOLDS[bed] < rarest_pair(fields, chances)
    columns = table.columns(*table.walk(steps, np.random.default_rng(0)))
    assert not learn(fields, columns, THRESHOLDS[bed])[-steps // 5 :].any()


# What it is good for ------------------------------------------------------------------

THRESHOLDS = {frozen_lake: 1e-4, cliff_walking: 1e-5, taxi: 1e-5}
WALKS = {frozen_lake: (5000, 0), cliff_walking: (12_000, 0), taxi: (30_000, 2)}
PATIENCE = 100


@dataclass(frozen=True)
class Taught:
    """What an agent is after a random walk, and the table it is true of."""

    env: BinarySensors
    table: Table
    body: Body
    memory: bytes
    truth: NDArray[np.bool_]

    @property
    def snapshot(self) -> EmpiricalSnapshot:
        return EmpiricalSnapshot.from_bytes(self.memory)

    def believes(self, a: str, b: str) -> bool:
        sensorium = Sensorium(self.body.sensors)
        return self.snapshot.poc_graph().leq(sensorium.literal(a), sensorium.literal(b))

    def at(self, goal: Sequence[str]) -> NDArray[np.bool_]:
        """At which places all of `goal` holds."""
        fields = state_fields(self.env, self.table)
        held = [
            fields[self.env.sensors.index(literal.rstrip("*"))] ^ literal.endswith("*")
            for literal in goal
        ]
        at: NDArray[np.bool_] = np.logical_and.reduce(held)
        return at


def taught(
    env: BinarySensors,
    threshold: float,
    steps: int,
    seed: int = 0,
    kind: AgentKind = "walker",
) -> Taught:
    """Let an agent, a random one unless said otherwise, act for so many steps."""
    table = Table.of(env)
    body = Body.full(env.sensors, env.actions, env.orders)
    snapshot = EmpiricalSnapshot(Sensorium(body.sensors), threshold)
    agent = Agent(body, new_policy(kind, body, seed), snapshot)
    going_on = Continuing(env)
    bits, info = going_on.reset(seed=seed)
    for _ in range(steps):
        decision = agent.act(bits, info["begins"])
        bits, _, _, _, info = going_on.step(decision.action)
    truth = recordable(transition_fields(env, table, body.context))
    return Taught(env, table, body, snapshot.to_bytes(), truth)


@functools.cache
def walker(bed: Callable[..., BinarySensors]) -> Taught:
    """An agent that made a random walk in a bed, and has learned all there is."""
    after = taught(bed(), THRESHOLDS[bed], *WALKS[bed])
    np.testing.assert_array_equal(after.snapshot.poc_graph().edges, after.truth)
    return after


def distances(table: Table, at: NDArray[np.bool_]) -> list[float]:
    """The fewest actions to a place of `at` within an episode, one by one."""
    far = [0.0 if here else np.inf for here in at]
    moves = [
        (before, after)
        for before, after in zip(table.before, table.after, strict=True)
        if not table.over[before]
    ]
    for _ in range(len(far)):
        for before, after in moves:
            far[before] = min(far[before], far[after] + 1)
    return far


def attempt(
    who: Taught,
    start: int,
    at: NDArray[np.bool_],
    kind: AgentKind = "planner",
    goal: Sequence[str] = (),
    explore: float = 0.0,
) -> list[Situation]:
    """Where an agent goes from a place, until it is there or the episode is over."""
    seed = 1000 * int(at.argmax()) + start
    policy = new_policy(kind, who.body, seed, target=goal, explore=explore)
    agent = Agent(who.body, policy, who.snapshot)
    there = {
        place for place, here in zip(situations(who.table), at, strict=True) if here
    }
    who.env.reset(seed=seed)
    inner: Any = who.env.unwrapped
    inner.s = int(who.table.states[start])
    bits: NDArray[Any] = state_readings(who.env)
    way = [(inner.s, False)]
    while way[-1] not in there and not way[-1][1] and len(way) <= PATIENCE:
        action = agent.act(bits, begins=len(way) == 1).action
        bits, _, over, _, _ = who.env.step(action)
        way.append((int(inner.s), over))
    return way


def state_readings(env: BinarySensors) -> NDArray[np.bool_]:
    inner: Any = env.unwrapped
    state = env.state_of(inner.s, {})
    return np.array([one.order == 0 and one(state) for one in env.definitions])


def tile(env: BinarySensors, row: int, column: int) -> tuple[str, ...]:
    """The literals that hold at one tile, of those next to it."""
    bounds = [("row", row), ("column", column)]
    literals = [
        *(f"{name}<{value}*" for name, value in bounds),
        *(f"{name}<{value + 1}" for name, value in bounds),
    ]
    return tuple(one for one in literals if one.rstrip("*") in env.sensors)


def outcomes(
    who: Taught, width: int, explore: float = 0.0
) -> tuple[Counter[str], list[float]]:
    """How the planner fares from everywhere to everywhere, and the steps too many."""
    table, found, extra = who.table, Counter[str](), []
    bad = {(state, True) for state in (5, 7, 11, 12)} if width == 4 else set()
    for goal, place in enumerate(situations(table)):
        if place in bad:
            continue
        kind = "goal" if place[1] else "tile"
        literals = (
            ("tile=goal",) if place[1] else tile(who.env, *divmod(place[0], width))
        )
        at = who.at(literals)
        assert at.nonzero()[0].tolist() == [goal]
        far = distances(table, at)
        for start in (~table.over & ~at).nonzero()[0].tolist():
            way = attempt(who, start, at, "planner", literals, explore)
            if way[-1] == place:
                found[f"{kind} reached"] += 1
                extra.append(len(way) - 1 - far[start])
            elif way[-1] in bad:
                found[f"{kind} drowned"] += 1
            else:
                found[f"{kind} {'passed by' if way[-1][1] else 'never reached'}"] += 1
    return found, extra


def test_on_the_lake_the_planner_gets_there_or_falls_into_a_hole() -> None:
    lake = walker(frozen_lake)
    found, extra = outcomes(lake, 4)
    # It never goes round and round; of 110 pairs of tiles it does 77.
    assert found == {
        "tile reached": 77,
        "tile drowned": 33,
        "goal reached": 4,
        "goal drowned": 7,
    }
    assert min(extra) == 0
    assert np.mean(np.array(extra) == 0) > 0.7


def test_most_holes_are_not_foreseen() -> None:
    lake = walker(frozen_lake)
    inner: Any = lake.env.unwrapped
    sensorium = Sensorium(lake.body.sensors)
    hole, safe = sensorium.literal("tile=hole"), sensorium.literal("tile=hole*")
    foreseen = {}
    for (state, over), action, (after, _) in sorted(moves(lake.table)):
        if over or after not in (5, 7, 11, 12):
            continue
        lake.env.reset(seed=0)
        inner.s = state
        agent = Agent(lake.body, new_policy("walker", lake.body, 0), lake.snapshot)
        agent.act(state_readings(lake.env), begins=True)
        bound = agent.consequences(action)
        foreseen[state, lake.env.actions[action]] = bool(bound[hole])
        assert not bound[safe]
    # What is sensed is a row or a column, in one of which there is ice as well; only
    # the last column has no other tile above a hole that one can stand on.
    assert {move for move, known in foreseen.items() if known} == {(3, "down")}
    assert len(foreseen) == 9


def test_walking_by_the_cliff_the_planner_reaches_the_goal_from_everywhere() -> None:
    cliff = walker(cliff_walking)
    at = cliff.at(["tile=goal"])
    far = distances(cliff.table, at)
    for start in (~cliff.table.over).nonzero()[0].tolist():
        way = attempt(cliff, start, at, "planner", ["tile=goal"])
        assert way[-1] == (47, True)
        assert len(way) - 1 <= far[start] + 12
        # And does not fall: none of its steps leads from the edge to the start.
        edge = {(state, False) for state in range(25, 35)}
        assert not any(a in edge and b == (36, False) for a, b in pairwise(way))


def test_what_it_knows_of_the_cliff() -> None:
    cliff = walker(cliff_walking)
    # That the way down from the row above leads to the bottom, not to which end of it;
    # that whoever starts to the right falls back to the start.
    assert cliff.believes("down&~row<2", "row<3*")
    assert not cliff.believes("down&~row<2", "tile=start")
    assert cliff.believes("right&tile=start", "tile=start")
    for column in range(1, 12):
        left, right = f"column<{column}", f"column<{column}*"
        # Going up or down keeps the column, but for those who fall.
        for action in ("up", "down"):
            assert cliff.believes(f"{action}&{left}", left)
        assert cliff.believes(f"up&~{left}", right)
        assert cliff.believes(f"down&~{left}", right) == (column == 11)
    # What cannot be undone: ten ways down, and the one to the goal.
    table = cliff.table
    alive = ~table.over[table.before]
    ways = set(zip(table.before[alive], table.after[alive], strict=True))
    lost = [(b, a) for b, a in ways if (a, b) not in ways]
    assert len(lost) == 11
    # So time is not spent evenly, as prop:convergence has it for reversible moves.
    shares = table.stationary()
    assert shares.max() > 1000 * shares.min()


def test_what_cannot_be_undone_keeps_the_planner_from_going_down() -> None:
    cliff = walker(cliff_walking)
    row, column = 1, 5
    literals = tile(cliff.env, row, column)
    at = cliff.at(literals)
    start = int((cliff.table.states == column).argmax())
    stuck = attempt(cliff, start, at, "planner", literals)
    # One step down would do. But that is believed to lose the column, and up is not.
    assert {state for state, _ in stuck} == {column}
    assert len(stuck) == PATIENCE + 1
    assert attempt(cliff, start, at, "planner", literals, 0.2)[-1] == (17, False)


STOPS = {"red": (0, 0), "green": (0, 4), "yellow": (4, 0), "blue": (4, 3)}


def cab_at(cab: Taught, row: int, column: int, passenger: int, destination: int) -> int:
    inner: Any = cab.env.unwrapped
    state = inner.encode(row, column, passenger, destination)
    return int(((cab.table.states == state) & ~cab.table.over).argmax())


def test_walls_stop_the_planner_but_in_the_row_that_has_none() -> None:
    cab = walker(taxi)
    found = Counter[tuple[int, bool]]()
    for row, column in itertools.product(range(5), repeat=2):
        goal = tile(cab.env, row, column)
        at = cab.at(goal)
        for stop in STOPS.values():
            start = cab_at(cab, *stop, 0, 1)
            if not at[start]:
                way = attempt(cab, start, at, goal=goal)
                there = cab.table.states[at].tolist()
                found[row, way[-1][0] in there] += 1
    # The middle row is open. To the others it goes straight, and stays at a wall.
    assert [found[row, True] for row in range(5)] == [8, 10, 20, 8, 6]
    assert [found[row, False] for row in range(5)] == [10, 10, 0, 12, 12]
    # East never leads back, but whether it leads on is known in the last columns only:
    # elsewhere it depends on the row, and a context is a single sensation.
    for k in range(1, 5):
        assert cab.believes(f"east&~column<{k}", f"column<{k}*")
    assert not cab.believes("west&column<2", "column<1")
    assert not cab.believes("east&~column<2", "column<3*")
    assert cab.believes("east&~column<3", "column<4*")


def test_a_fare_ends_where_what_matters_is_two_things_at_once() -> None:
    cab = walker(taxi)
    # To be picked up, one must be where the taxi is: no single sensation says so.
    assert not cab.believes("pickup&passenger=red", "passenger=taxi")
    assert not cab.believes("dropoff&passenger=taxi", "passenger=taxi*")
    assert cab.believes("pickup&passenger=taxi", "passenger=taxi")
    assert cab.believes("dropoff&passenger=red", "passenger=red")
    # At its stop it happens, since nothing else is better; the delivery does not:
    # to keep the passenger guarantees more.
    for number, (name, stop) in enumerate(STOPS.items()):
        waiting = cab_at(cab, *stop, number, (number + 1) % 4)
        way = attempt(cab, waiting, cab.at(["passenger=taxi"]), goal=["passenger=taxi"])
        assert len(way) - 1 < PATIENCE
        arrived = cab_at(cab, *stop, 4, number)
        goal = (*tile(cab.env, *stop), f"passenger={name}")
        at = cab.at(goal) & cab.table.over
        assert len(attempt(cab, arrived, at, goal=goal)) - 1 == PATIENCE


def drawn_to(bed: Callable[..., BinarySensors], goal: Situation) -> BinarySensors:
    """A bed with `better` and `worse`, by the fewest actions to a place."""
    bare = bed()
    table = Table.of(bare)
    at = np.array([place == goal for place in situations(table)])
    far = {
        bare.state_of(state, {}): distance
        for state, distance in zip(
            table.states.tolist(), distances(table, at), strict=True
        )
    }
    scent = (decreased("better", far.__getitem__), increased("worse", far.__getitem__))
    return BinarySensors(
        bare.env,
        (*bare.definitions, *scent),
        lambda _, observation, info: bare.state_of(observation, info),
        bare.actions,
    )


@pytest.mark.parametrize(
    ("bed", "goal", "kind", "steps", "reached", "starts"),
    [
        (frozen_lake, (15, True), "walker", 8000, 3, 11),
        (frozen_lake, (15, True), "excited", 8000, 9, 11),
        (cliff_walking, (47, True), "walker", 40_000, 37, 37),
        (cliff_walking, (47, True), "excited", 10_000, 37, 37),
    ],
)
def test_an_excited_agent_goes_where_it_gets_better(
    bed: Callable[..., BinarySensors],
    goal: Situation,
    kind: AgentKind,
    steps: int,
    reached: int,
    starts: int,
) -> None:
    who = taught(drawn_to(bed, goal), THRESHOLDS[bed], steps, kind=kind)
    # Only who went everywhere knows all, and nothing that is false.
    learned = np.array_equal(who.snapshot.poc_graph().edges, who.truth)
    assert learned == (kind == "walker")
    at = np.array([place == goal for place in situations(who.table)])
    alive = (~who.table.over).nonzero()[0].tolist()
    ways = [attempt(who, start, at, "excited", explore=0.2) for start in alive]
    assert len(alive) == starts
    assert sum(way[-1] == goal for way in ways) == reached


# In a swarm ---------------------------------------------------------------------------


def lake_run(log: Path) -> RunOptions:
    """Record a planner on the lake, with every sensor a cell, over some episodes."""
    source = open_source("neurosnap/FrozenLake-v0", 0)
    source.close()
    options = RunOptions(
        source="neurosnap/FrozenLake-v0",
        body=body_of(source, "planner"),
        agent="planner",
        target=("tile=goal",),
        explore=0.5,
        ticks=40,
        seed=0,
        cells="inline",
    )
    asyncio.run(run(options, log, asyncio.Event()))
    return options


def observed(log: Path) -> list[wire.Observation]:
    messages = (one.message for one in Recording.open(log).messages(("observe",)))
    return [one for one in messages if isinstance(one, wire.Observation)]


def test_a_swarm_senses_no_action_where_an_episode_begins(tmp_path: Path) -> None:
    options = lake_run(tmp_path / "log")
    source = open_source(options.source, options.seed)
    agent = Agent(options.body, options.new_policy(), options.new_snapshot())
    bits, own = source.first(), len(source.sensors)
    decisions = []
    assert bits is not None
    for one in observed(tmp_path / "log"):
        sensed = unpack(one.bits, len(options.body.sensors))
        np.testing.assert_array_equal(sensed[:own], bits)
        assert one.begins == source.begins
        assert sensed[own:].any() != one.begins
        decisions.append(agent.act(bits, source.begins))
        after = source.step(decisions[-1].action)
        assert after is not None
        bits = after
    messages = (one.message for one in Recording.open(tmp_path / "log").messages())
    decided = [one for one in messages if isinstance(one, wire.Decision)]
    assert decided[1:] == decisions[:-1]  # nobody would answer the last one
    begins = [one.tick for one in observed(tmp_path / "log") if one.begins]
    assert begins[0] == 1
    assert len(begins) > 2
    verdict = verify(tmp_path / "log")
    assert (verdict.same, verdict.complete) == (True, True)


def test_a_beginning_that_is_kept_quiet_is_noticed(tmp_path: Path) -> None:
    lake_run(tmp_path / "log")
    recording = Recording.open(tmp_path / "log")
    tick = [one.tick for one in observed(tmp_path / "log") if one.begins][1]
    with Writer(tmp_path / "changed") as writer:
        writer.start(recording.metadata)
        for recorded in recording.messages():
            delivery, message = recorded.delivery, recorded.message
            if isinstance(message, wire.Observation) and message.tick == tick:
                forged = msgspec.structs.replace(message, begins=False)
                delivery = delivery._replace(payload=wire.encode(forged))
            writer.add(delivery, recorded.log_time)
    verdict = verify(tmp_path / "changed")
    assert not verdict.same
    assert f"tick {tick}: /observe: " in str(verdict.difference)
    assert "does not follow from the decision" in str(verdict.difference)
