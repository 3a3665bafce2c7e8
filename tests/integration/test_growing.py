"""Agents grow sensors in worlds where one sensor alone does not predict the outcome."""

import functools
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.agent import Agent
from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.planner import Planner
from neurosnap.wire import Decision
from tests.support.aliased_worlds import ring, t_maze
from tests.support.exhaustive import rows
from tests.support.taught_agents import distances, state_readings
from tests.support.transition_tables import Table, state_fields
from tools.paper.explorers import Explorer
from tools.paper.stages import Setting, Stage, StageEnv, stage_of
from world.toy_text import cliff_walking, frozen_lake

pytestmark = pytest.mark.slow


class Grown:
    """An agent that explored a world, held against the table of that world."""

    def __init__(
        self, env: BinarySensors, steps: int, seed: int, **options: Any
    ) -> None:
        self.env, self.table, self.greedy = env, Table.of(env), False
        self.fields = np.array(state_fields(env, self.table))
        given = {"grow": True, "imagine": True, "explore": 0.0, **options}
        self.agent = Agent.of(env, "planner", target=["row<1"], seed=seed, **given)
        self.agent.learn(env, steps, seed=seed)

    def literals(self, place: int) -> set[int]:
        return {
            2 * sensor + (not on) for sensor, on in enumerate(self.fields[:, place])
        }

    def moves(self) -> tuple[int, int, int]:
        """Return how many moves are guaranteed whole, falsely, and how many there are.

        Moves from where an episode is over are none.
        """
        graph = self.agent.snapshot.poc_graph()
        actions = Actions(self.agent.body)
        own = 2 * len(self.agent.body.own)
        whole = false = count = 0
        table = self.table
        for before, action, after in zip(
            table.before.tolist(),
            table.action.tolist(),
            table.after.tolist(),
            strict=True,
        ):
            if table.over[before]:
                continue
            state = np.zeros(2 * len(self.agent.body.sensors), np.bool_)
            state[list(self.literals(before))] = True
            closure = graph.up(actions.signals(state)[action])
            said = set(np.flatnonzero(guaranteed([closure])[0][:own]).tolist())
            whole += said >= self.literals(after)
            false += not said <= self.literals(after)
            count += 1
        return whole, false, count

    def journeys(self, every: int = 1) -> list[tuple[int, float]]:
        """Go from each place to each, and return steps taken and steps needed."""
        found = []
        table, env = self.table, self.env
        for goal in range(0, len(table.states), every):
            at = (self.fields == self.fields[:, [goal]]).all(axis=0)
            need = distances(table, at)
            for start in range(len(table.states)):
                if not table.over[start] and 0 < need[start] < np.inf:
                    taken = self.send(start, goal, int(need[start]))
                    found.append((taken, need[start]))
        env.close()
        return found

    def send(self, start: int, goal: int, most: int) -> int:
        """Return the steps to a place; one more than `most` if that is not enough."""
        env, goal_reads = self.env, self.fields[:, goal]
        inner: Any = env.unwrapped
        if self.greedy:
            body = self.agent.body
            self.agent._mind.policy = Planner(body, self.literals(goal), 0, explore=0.0)
        else:
            self.agent.aim(self.literals(goal))
        self.agent.set_down()
        env.reset(seed=0)
        inner.s = int(self.table.states[start])
        bits = state_readings(env)
        for steps in range(most + 1):
            if np.array_equal(bits, goal_reads):
                return steps
            action = self.agent.act(bits, begins=steps == 0).action
            bits = np.asarray(env.step(action)[0], np.bool_)
        return most + 1


@functools.cache
def lake(seed: int = 0) -> Grown:
    """Return an agent that explored the lake; tests go on with copies of it."""
    return Grown(frozen_lake(), 1000, seed)


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_every_move_on_the_lake_is_guaranteed_and_every_way_the_shortest(
    seed: int,
) -> None:
    grown = deepcopy(lake(seed))
    assert grown.moves() == (44, 0, 44)
    assert len(grown.agent.body.in_use) <= 25
    journeys = grown.journeys()
    assert len(journeys) == 165
    assert [taken for taken, _ in journeys] == [need for _, need in journeys]


@pytest.mark.exhaustive
def test_every_move_at_the_cliff_is_guaranteed_and_every_way_the_shortest() -> None:
    cliff = Grown(cliff_walking(), 3000, 0)
    assert cliff.moves() == (148, 0, 148)
    assert len(cliff.agent.body.in_use) <= 35
    journeys = cliff.journeys(every=6)
    assert [taken for taken, _ in journeys] == [need for _, need in journeys]


def test_neither_growth_nor_imagining_alone_is_enough() -> None:
    plain = Grown(frozen_lake(), 1000, 0, grow=False)
    assert plain.agent.body.grown == ()
    whole, _, count = plain.moves()
    assert whole < count
    greedily = deepcopy(lake())
    greedily.greedy = True
    for one in (plain, greedily):
        assert any(taken > need for taken, need in one.journeys(every=5))


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_sensors_that_are_coins_cost_no_move_and_are_told_as_chance(seed: int) -> None:
    lake = Setting(name="coins", world="neurosnap/FrozenLake-v0", steps=0, coins=3)
    stage = stage_of(lake)
    agent = Explorer.of(StageEnv(stage), "planner", seed=seed, grow=True, imagine=True)
    agent.learn(StageEnv(stage), 2000, seed=seed)
    assert agent.whole(stage) == (44, 0, 44)
    assert len(agent.body.in_use) <= 40
    coins = ("coin_0", "coin_1", "coin_2")
    assert agent.chance == dict.fromkeys(agent.body.actions, coins)


def test_where_every_action_slips_it_says_so_and_grows_little() -> None:
    lake = frozen_lake(is_slippery=True)
    agent = Agent.of(lake, "planner", grow=True, imagine=True, seed=0)
    told = list[tuple[int, int]]()
    act = agent.act

    def acting(*given: Any, **named: Any) -> Decision:
        action = agent.decision.action
        decision = act(*given, **named)
        told.extend((action, literal) for literal in decision.chance)
        return decision

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(agent, "act", acting)
        agent.learn(lake, 2000, seed=0)
    assert len(agent.body.in_use) <= 40
    for action, name in enumerate(agent.body.actions):
        assert {"column<1", "row<1"} & set(agent.chance[name])
        for sensor in agent.chance[name]:
            number = agent.body.own.index(sensor)
            assert {(action, 2 * number), (action, 2 * number + 1)} & set(told)


# Where places look alike: what was done a step before tells them apart --------------


def explored(stage: Stage, steps: int, seed: int) -> Agent:
    agent = Agent.of(StageEnv(stage), "planner", seed=seed, grow=True, imagine=True)
    agent.learn(StageEnv(stage), steps, seed=seed)
    return agent


def sent(agent: Agent, stage: Stage, goal: str, start: int, seed: int) -> int:
    """Return the steps from a place to a goal, of 60 at most."""
    chances = np.arange(len(stage.start)) == start
    env = StageEnv(Stage(**{**vars(stage), "start": chances.astype(np.float64)}))
    outing = agent.send(env, [goal], 60, seed=seed)
    assert outing.reached
    return outing.steps


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_in_a_t_maze_what_was_seen_at_the_start_tells_where_to_turn(seed: int) -> None:
    maze = t_maze()
    agent = explored(maze, 600, seed)
    assert len(agent.body.in_use) <= 20
    assert any(agent.body.split(literals)[1] for _, literals in agent.body.in_use)
    taken = [
        sent(agent, maze, "food", start, 50 + k) for k in range(5) for start in (0, 1)
    ]
    assert taken == [2] * 10


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_on_a_ring_dark_places_are_told_apart_by_the_beacon_one_came_from(
    seed: int,
) -> None:
    around = ring(4, (0, 2))
    agent = explored(around, 600, seed)
    assert len(agent.body.in_use) <= 20
    assert agent.chance == {}
    assert sent(agent, around, "beacon_0", start=2, seed=seed) == 2
    # From a dark place, one step, or three if what it takes first leads away.
    for start in (1, 3):
        assert sent(agent, around, "beacon_0", start, seed) in (1, 3)


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_where_one_step_back_is_not_enough_it_says_so_and_arrives_all_the_same(
    seed: int,
) -> None:
    around = ring(6, (0, 3))
    agent = explored(around, 2000, seed)
    assert len(agent.body.in_use) <= 20
    assert agent.chance == dict.fromkeys(("left", "right"), around.sensors)
    for start in range(1, 6):
        sent(agent, around, "beacon_0", start, seed)


# Exploring by plan --------------------------------------------------------------------


def test_an_agent_that_runs_by_plan_does_what_it_does_when_it_learns() -> None:
    env = frozen_lake()
    given: dict[str, Any] = {"grow": 4, "imagine": 300, "seed": 5}
    # What it is told to reach is not what it learns for.
    one = Agent.of(env, "planner", target=["row<1"], **given)
    one.learn(env, 200, seed=1)
    two = Agent.of(env, "planner", explore="planned", **given)
    two.run(env, 200, seed=1)
    assert one.body == two.body
    assert one.snapshot.to_bytes() == two.snapshot.to_bytes()
