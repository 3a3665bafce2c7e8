"""The tables of worlds nobody made for us are right.

What is right is found here a second time, by stepping Gymnasium's own environments from
every state there is.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.toy_text.taxi import TaxiEnv

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.environment import Continuing
from neurosnap.errors import InvalidValueError
from tests.support.toy_text_beds import BEDS, VARIANTS, Move, Situation, moves
from tests.support.transition_tables import Table, state_fields
from world.toy_text import cliff_walking, frozen_lake, taxi

EXACT = [frozen_lake, cliff_walking]  # no chance in them, not even at a reset


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
