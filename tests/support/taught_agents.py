"""Trains agents by a random walk in a toy-text world, and returns their paths."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.body import Body
from neurosnap.agent.environment import Continuing
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.policy_kinds import new_policy
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.sensorium import Sensorium
from tests.support.transition_tables import (
    Situation,
    Table,
    recordable,
    state_fields,
    transition_fields,
)
from world.toy_text import cliff_walking, frozen_lake, taxi

Bed = Callable[..., BinarySensors]
BEDS: list[Bed] = [frozen_lake, cliff_walking, taxi]
THRESHOLDS: dict[Bed, float] = {frozen_lake: 1e-4, cliff_walking: 1e-5, taxi: 1e-5}
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
def walker(bed: Bed) -> Taught:
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
    situations = who.table.situations
    there = {place for place, here in zip(situations, at, strict=True) if here}
    who.env.reset(seed=seed)
    inner: Any = who.env.unwrapped
    inner.s = int(who.table.states[start])
    state, definitions = who.env.state_of(inner.s, {}), who.env.definitions
    bits: NDArray[Any] = np.array([d.order == 0 and d(state) for d in definitions])
    way = [(inner.s, False)]
    while way[-1] not in there and not way[-1][1] and len(way) <= PATIENCE:
        action = agent.act(bits, begins=len(way) == 1).action
        bits, _, over, _, _ = who.env.step(action)
        way.append((int(inner.s), over))
    return way


def tile(env: BinarySensors, row: int, column: int) -> tuple[str, ...]:
    """The literals that hold at one tile, of those next to it."""
    bounds = [("row", row), ("column", column)]
    literals = [
        *(f"{name}<{value}*" for name, value in bounds),
        *(f"{name}<{value + 1}" for name, value in bounds),
    ]
    return tuple(one for one in literals if one.rstrip("*") in env.sensors)
