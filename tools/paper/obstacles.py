"""Agents with complete knowledge in worlds with obstacles.

Knowledge is perfect exposure: a snapshot that has seen every action at every place
equally often, in an order drawn once. Then an agent is put down at each place in turn
and is to reach the target; it goes on learning on its way.

References:
    [GK] "Obstructions to Greedy Reactive Planning": a punctured grid, a circular rail.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.policy import EXPLORE, AgentKind
from neurosnap.agent.policy_kinds import new_policy
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.sensorium import complete
from tools.paper.table import Entry
from tools.paper.walks import World, world_of

AgentName: TypeAlias = Literal["greedy", "excited", "random"]

ARRIVED, BLOCKED = range(2)
"""The columns of a start's row: steps until it arrived, -1 for never; and how often it
was kept from a place that should have been there."""

_KINDS: dict[AgentName, AgentKind] = {
    "greedy": "planner",
    "excited": "excited",
    "random": "walker",
}
_TIMES = 20  # how often every action is seen at every place


class ObstacleEntry(Entry, frozen=True, kw_only=True):
    """One agent in one world, started once from every place; seeds tell runs apart."""

    VERSION = 2

    world: str
    """The environment's id."""
    agent: AgentName
    """Who is put down."""
    target: int
    """The place to get to."""
    goal: tuple[str, ...]
    """The same as sensations; the agent has arrived where all of them hold."""
    limit: int
    """Steps it is given."""

    def row(self, run: int) -> NDArray[np.int32]:
        """Return what became of an agent put down at each place: ``(places, 2)``."""
        known = arena(self.world, self.target)
        starts = range(known.world.moves.shape[1])
        return np.array([_journey(self, known, run, start) for start in starts], "i4")


@dataclass(frozen=True)
class Arena:
    """A world with a target, and the snapshot of an agent that has seen all of it."""

    world: World
    blocked: NDArray[np.bool_]
    """``(actions, places)``: the action would lead to a place that is missing."""
    snapshot: bytes

    def reached(self, goal: tuple[str, ...]) -> NDArray[np.bool_]:
        """Return at which places all sensations of `goal` hold: ``(places,)``."""
        fields = dict(zip(self.world.body.own, self.world.fields, strict=False))
        held = [
            ~fields[name[:-1]] if name.endswith("*") else fields[name] for name in goal
        ]
        there: NDArray[np.bool_] = np.logical_and.reduce(held)
        return there


@lru_cache(maxsize=8)
def arena(name: str, target: int) -> Arena:
    """Return a world and what there is to know of it."""
    world = world_of(name, target=target)
    return Arena(world, _blocked(world), _learned(world))


def _learned(world: World) -> bytes:
    """Return the snapshot of an agent that saw everything, `_TIMES` over."""
    # Between the shares of one transition and of two: one exception is forgiven.
    threshold = 1.5 / world.moves.size
    snapshot = EmpiricalSnapshot(len(world.body.sensors), threshold)
    senses, places = Senses(world.body), world.moves.shape[1]
    state = np.zeros(2 * len(world.body.sensors), np.bool_)
    generator = np.random.default_rng(0)
    for _ in range(_TIMES):
        for transition in generator.permutation(world.moves.size).tolist():
            action, before = divmod(transition, places)
            after = int(world.moves[action, before])
            state[: 2 * len(world.fields)] = complete(world.fields[:, before])
            bits = world.sense(after, before)
            snapshot.learn(senses.observe(bits, None, action, state)[0])
    return snapshot.to_bytes()


def _blocked(world: World) -> NDArray[np.bool_]:
    """Return which actions stay where a neighbour is missing that is within bounds.

    In a world without coordinates none does.

    An action is known by where it leads from everywhere else.
    """
    moves, coordinates = world.moves, world.coordinates
    blocked = np.zeros(moves.shape, np.bool_)
    if not len(coordinates):
        return blocked
    there = {tuple(at) for at in coordinates.tolist()}
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    for action, leads in enumerate(moves):
        steps = coordinates[leads] - coordinates
        moved = np.abs(steps).sum(axis=1) == 1
        if not moved.any():
            continue
        ways, counts = np.unique(steps[moved], axis=0, return_counts=True)
        aims = coordinates + ways[counts.argmax()]
        inside = ((aims >= low) & (aims <= high)).all(axis=1)
        missing = np.array([tuple(aim) not in there for aim in aims.tolist()])
        blocked[action] = inside & missing
    return blocked


def _journey(
    cell: ObstacleEntry, known: Arena, run: int, start: int
) -> tuple[int, int]:
    """Put an agent down at a place; see `ARRIVED` and so on for what is returned."""
    key, world = (run, start), known.world
    (seed,) = np.random.SeedSequence(cell.seed, spawn_key=key).generate_state(1)
    policy = new_policy(
        _KINDS[cell.agent],
        world.body,
        int(seed),
        target=cell.goal if cell.agent == "greedy" else (),
        explore=EXPLORE if cell.agent == "excited" else 0.0,
    )
    agent = Agent(world.body, policy, EmpiricalSnapshot.from_bytes(known.snapshot))
    there = known.reached(cell.goal)
    place = before = start
    blocked = 0
    for step in range(cell.limit + 1):
        if there[place]:
            return step, blocked
        action = agent.act(world.sense(place, before)).action
        blocked += int(known.blocked[action, place])
        before, place = place, int(world.moves[action, place])
    return -1, blocked
