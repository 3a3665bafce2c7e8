"""Agents grow sensors in worlds where one sensor alone does not predict the outcome."""

import functools
import re
from copy import deepcopy
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.plan import ContingentPlan
from neurosnap.sensorium import Sensorium, complete
from neurosnap.wire import Decision
from tests.support.aliased_worlds import ring, room, t_maze
from tests.support.exhaustive import rows
from tools.paper.explorers import Explorer, journey
from tools.paper.worlds_as_tables import Setting, Stage, StageEnv, stage_of
from world.toy_text import frozen_lake

pytestmark = pytest.mark.slow

(LAKE, CLIFF, COINS) = (
    stage_of(Setting(name="", world=f"neurosnap/{world}-v0", steps=0, coins=coins))
    for world, coins in (("FrozenLake", 0), ("CliffWalking", 0), ("FrozenLake", 3))
)

SLIPPERY = stage_of(
    Setting(
        name="",
        world="neurosnap/FrozenLake-v0",
        arguments=(("is_slippery", True),),
        steps=0,
    )
)


def explored(stage: Stage, steps: int, seed: int, **options: Any) -> Explorer:
    given = {"seed": seed, "grow": True, "imagine": True, **options}
    agent = Explorer.of(StageEnv(stage), "planner", **given)
    agent.learn(StageEnv(stage), steps, seed=seed)
    return agent


@functools.cache
def lake(seed: int = 0) -> Explorer:
    """Return an agent that explored the lake; tests go on with copies of it."""
    return explored(LAKE, 1000, seed)


def journeys(
    agent: Explorer, stage: Stage, every: int = 1, *, imagine: bool = True
) -> tuple[list[int], list[int]]:
    """Go from each place to each; return steps taken, -1 if too many, and needed."""
    taken, needed = list[int](), list[int]()
    for goal in range(0, len(stage.over), every):
        need = stage.distances((stage.fields[:, goal] == stage.fields.T).all(axis=1))
        wanted = complete(stage.fields[:, goal])
        for start in np.flatnonzero(
            ~stage.over & (need > 0) & (need < np.inf)
        ).tolist():
            needed.append(int(need[start]))
            way = journey(agent, stage, start, wanted, needed[-1], imagine=imagine)
            taken.append(way.steps)
    return taken, needed


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_every_move_on_the_lake_is_guaranteed_and_every_way_the_shortest(
    seed: int,
) -> None:
    agent = deepcopy(lake(seed))
    assert agent.whole(LAKE) == (44, 0, 44)
    assert len(agent.body.in_use) <= 25
    taken, needed = journeys(agent, LAKE)
    assert len(taken) == 165
    assert taken == needed


@pytest.mark.exhaustive
def test_every_move_at_the_cliff_is_guaranteed_and_every_way_the_shortest() -> None:
    agent = explored(CLIFF, 3000, 0)
    assert agent.whole(CLIFF) == (148, 0, 148)
    assert len(agent.body.in_use) <= 35
    taken, needed = journeys(agent, CLIFF, every=6)
    assert taken == needed


def test_neither_growth_nor_imagining_alone_is_enough() -> None:
    plain = explored(LAKE, 1000, 0, grow=False)
    assert plain.body.grown == ()
    whole, _, count = plain.whole(LAKE)
    assert whole < count
    for agent, imagine in ((plain, True), (deepcopy(lake()), False)):
        taken, _ = journeys(agent, LAKE, every=5, imagine=imagine)
        assert -1 in taken


def test_where_nothing_more_can_be_grown_it_goes_by_what_followed_in_the_past() -> None:
    agent = explored(LAKE, 1000, 0, grow=1)
    assert not agent.body.has_room
    whole, _, count = agent.whole(LAKE)
    assert whole < count
    taken, needed = journeys(agent, LAKE)
    assert taken == needed


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_sensors_that_are_coins_cost_no_move_and_are_told_as_chance(seed: int) -> None:
    agent = explored(COINS, 2000, seed)
    assert agent.whole(COINS) == (44, 0, 44)
    assert len(agent.body.in_use) <= 40
    coins = ("coin_0", "coin_1", "coin_2")
    assert set(agent.chance) == set(agent.body.actions)
    for told in agent.chance.values():  # either side of each
        assert min(told[name] for coin in coins for name in (coin, f"{coin}*")) > 0.7


def test_where_every_action_slips_it_says_so_and_grows_little() -> None:
    lake = frozen_lake(is_slippery=True)
    agent = Agent.of(lake, "planner", grow=True, imagine=True, seed=0)
    told, tries = list[tuple[int, int]](), list[bool]()
    act = agent.act

    def acting(*given: Any, **named: Any) -> Decision:
        action = agent.decision.action
        decision = act(*given, **named)
        told.extend((action, literal) for literal in decision.chance)
        tries.append(decision.why.startswith("comes to what was hardly tried"))
        return decision

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(agent, "act", acting)
        agent.learn(lake, 2000, seed=0)
    assert len(agent.body.in_use) <= 40
    assert sum(tries) > 200
    own = Sensorium(agent.body.own)
    for action, name in enumerate(agent.body.actions):
        assert {"column<1", "row<1"} & set(agent.chance[name])
        given_up = [result for by, result in told if by == action]
        assert {own.name(result) for result in given_up} <= set(agent.chance[name])


def chance(
    stage: Stage, actions: NDArray[np.int_] | None, at: NDArray[np.bool_]
) -> Any:
    """Return the chance to arrive from each place, by actions or by the best ones."""
    led = np.zeros((len(stage.over), len(stage.actions), len(stage.over)))
    for place, row in enumerate(stage.outcomes):
        for action, ways in enumerate(row if not stage.over[place] else ()):
            for share, after in ways:
                led[place, action, after] += share
    values = at.astype(np.float64)
    for _ in range(2000):
        ahead = led @ values
        best = ahead.max(axis=1)
        if actions is not None:
            best = ahead[np.arange(len(actions)), actions]
        values = np.where(at, 1.0, best)
    return values


@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_where_every_action_slips_its_plan_is_nearly_the_best_there_is(
    seed: int,
) -> None:
    agent = explored(SLIPPERY, 5000, seed)
    agent.aim(["tile=goal"])
    agent.set_down()
    first = int(SLIPPERY.start.argmax())
    decision = agent.act(SLIPPERY.fields[:, first], begins=True)
    experience = agent._mind.memory.experience
    assert experience is not None
    assert not experience.no_way
    named = sum(map(len, agent.chance.values()))
    assert named > experience.hopeless.sum()  # what is not given up yet, too
    plan = experience.plan
    assert isinstance(plan, ContingentPlan)
    actions = np.zeros(len(SLIPPERY.over), np.int_)
    state = np.zeros(2 * len(agent.body.sensors), np.bool_)
    for place in np.flatnonzero(~SLIPPERY.over).tolist():
        state[:] = False
        state[SLIPPERY.literals(place)] = True
        assert plan.goes_on(state, agent.decision.tick)
        actions[place] = plan.step(state)[0]
    goal = SLIPPERY.goals
    best, real = (
        chance(SLIPPERY, some, goal)[first].item() for some in (None, actions)
    )
    assert best == pytest.approx(14 / 17, abs=1e-3)
    assert real >= 0.8 * best
    told = re.fullmatch(
        r"arrives with a chance of (\d+) %: \w+, which led to .+ %\)", decision.why
    )
    assert told is not None
    assert abs(int(told[1]) / 100 - real) < 0.2


# Where places look alike: what was done a step before tells them apart --------------


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
    assert any(agent.body.split(one.literals)[1] for one in agent.body.in_use)
    taken = [
        sent(agent, maze, "food", start, 50 + k) for k in range(5) for start in (0, 1)
    ]
    assert taken == [2] * 10


@pytest.mark.parametrize(
    ("delay", "seed"), rows([(1, 0), (6, 1)], [(1, 1), (1, 2), (3, 0), (6, 0), (6, 2)])
)
def test_in_a_t_maze_what_was_seen_long_ago_is_kept_in_a_latch(
    delay: int, seed: int
) -> None:
    maze = t_maze(delay)
    agent = explored(maze, 2000, seed)
    assert len(agent.body.latches) == 1  # that it is off tells, too
    for turn, start in product(range(5), range(2)):
        steps = sent(deepcopy(agent), maze, "food", start, turn)
        assert steps == delay + 2


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
def test_where_one_step_back_is_not_enough_contexts_nest(seed: int) -> None:
    around = ring(6, (0, 3))
    agent = explored(around, 2000, seed)
    assert len(agent.body.in_use) <= 20
    assert any(name.count("(") >= 2 for name in agent.body.sensors)
    for goal, start in product((0, 3), range(6)):
        if start != goal:
            steps = sent(deepcopy(agent), around, f"beacon_{goal}", start, seed)
            assert steps <= 5  # at worst it first learns where it is
    [found] = agent.body.maps
    clone = agent.body.sensors[found.first]  # nothing reads it, and it can be gone to
    assert sent(agent, around, clone, 1, seed) <= 5


@pytest.mark.parametrize(
    ("size", "steps", "seed"),
    rows([((4, 5), 4000, 0)], [((6, 8), 12_000, 0), ((6, 8), 12_000, 1)]),
)
def test_in_a_room_of_four_colours_places_that_look_alike_are_told_apart(
    size: tuple[int, int], steps: int, seed: int
) -> None:
    stage = room(*size, seed)
    env = StageEnv(stage)
    agent = Agent.of(env, "walker", grow=True, seed=seed)
    agent.run(env, steps, seed=seed)
    [found] = agent.body.maps
    assert len(found.numbers) == len(stage.over)
    # A walk that was not learned from: what is to be read is known before each step.
    own, right = 2 * len(agent.body.own), 0
    clones: dict[int, set[int]] = {}
    random = np.random.default_rng(seed)
    env.reset(seed=seed + 1)
    agent.set_down()
    agent.act(env.reading())
    for _ in range(1000):
        action = int(random.integers(4))
        bound = agent.body.carried(agent.state, agent.consequences(action))[:own]
        agent.take(action)
        bits, *_ = env.step(action)
        right += bool((bound == complete(np.asarray(bits, np.bool_))).all())
        agent.act(bits)
        on = [k for k in found.numbers if agent.state[2 * k]]
        clones.setdefault(env.place, set()).update(on)
    assert right >= 970
    assert all(len(some) == 1 for some in clones.values())
    # From wherever it is, to a place by its clone: by a shortest way.
    for goal in random.permutation(list(clones))[:20].tolist():
        [clone] = clones[goal]
        away = stage.distances(np.arange(len(stage.over)) == goal)
        agent.aim([2 * clone])
        agent.act(env.step(agent.decision.action)[0])  # as it decided before
        while env.place != goal:
            before = away[env.place]
            agent.act(env.step(agent.decision.action)[0])
            assert away[env.place] == before - 1


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
