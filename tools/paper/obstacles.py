"""Agents with complete knowledge in worlds with obstacles.

Knowledge is perfect exposure: a snapshot that has seen every action at every place
equally often, in an order drawn once. Then an agent is put down at each place in turn
and is to reach the target; it goes on learning on its way.

References:
    [GK] "Obstructions to Greedy Reactive Planning": a punctured grid, a circular rail.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, Literal, TypeAlias

import gymnasium
import numpy as np
from numpy.typing import DTypeLike, NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policies import new_policy
from neurosnap.agent.policy import EXPLORE, AgentKind
from neurosnap.agent.senses import Senses
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.sensorium import complete
from neurosnap.sources.gymnasium_source import import_worlds
from tools.paper.table import Entry

AgentName: TypeAlias = Literal["greedy", "excited", "random"]

ARRIVED, BLOCKED, FIRST = range(3)
"""The columns of a start's row: steps until it arrived, -1 for never; how often it was
kept from a place that should have been there; its first action."""

_KINDS: dict[AgentName, AgentKind] = {
    "greedy": "planner",
    "excited": "excited",
    "random": "walker",
}
_TIMES = 20  # how often every action is seen at every place


class ObstacleEntry(Entry, frozen=True, kw_only=True):
    """One agent in one world, put down everywhere; its runs differ in their luck."""

    dtype: ClassVar[DTypeLike] = np.int32

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

    @property
    def name(self) -> str:
        """What people see of it in a listing of files."""
        world = self.world.removeprefix("neurosnap/").removesuffix("-v0").lower()
        return f"{self.agent}-{world}"

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a row: ``(places, 3)``."""
        return (len(arena(self.world, self.target).distances), 3)

    def row(self, run: int) -> NDArray[np.int32]:
        """Return what became of an agent put down at each place."""
        place = arena(self.world, self.target)
        starts = range(len(place.distances))
        return np.array([_journey(self, place, run, start) for start in starts], "i4")


@dataclass(frozen=True)
class Arena:
    """A world with a target, and what perfect exposure teaches of it."""

    body: Body
    moves: NDArray[np.intp]
    """``(actions, places)``; where an action leads."""
    fields: NDArray[np.bool_]
    """``(N, places)``; where each state sensor is on."""
    distances: NDArray[np.float64]
    """``(places,)``; to the target, in actions."""
    blocked: NDArray[np.bool_]
    """``(actions, places)``: the action would lead to a place that is missing."""
    coordinates: NDArray[np.intp]
    """``(places, 2)``; where to draw a place."""
    threshold: float
    """Between the shares of one transition and of two: one exception is forgiven."""
    snapshot: bytes

    def reached(self, goal: tuple[str, ...]) -> NDArray[np.bool_]:
        """Return at which places all sensations of `goal` hold: ``(places,)``."""
        fields = dict(zip(self.body.own, self.fields, strict=False))
        held = [
            ~fields[name[:-1]] if name.endswith("*") else fields[name] for name in goal
        ]
        there: NDArray[np.bool_] = np.logical_and.reduce(held)
        return there

    def sense(self, place: int, before: int) -> NDArray[np.bool_]:
        """Return what the world's own sensors read after a step."""
        nearer = self.distances[place] < self.distances[before]
        farther = self.distances[place] > self.distances[before]
        return np.append(self.fields[:, place], (nearer, farther))


@lru_cache(maxsize=8)
def arena(world: str, target: int) -> Arena:
    """Return a world and what there is to know of it."""
    import_worlds()
    env: gymnasium.Env[Any, Any] = gymnasium.make(world, target=target)
    try:
        get = env.get_wrapper_attr
        moves, fields, distances = get("moves"), get("fields"), get("distances")
        body = Body.full(get("sensors"), get("actions"), get("orders"))
        if env.has_wrapper_attr("coordinates"):
            coordinates = get("coordinates")
        else:
            here = np.arange(moves.shape[1])
            coordinates = np.stack([here, np.zeros_like(here)], axis=1)
    finally:
        env.close()
    blank = Arena(
        body=body,
        moves=moves,
        fields=fields,
        distances=distances,
        blocked=_blocked(moves, coordinates),
        coordinates=coordinates,
        threshold=1.5 / moves.size,
        snapshot=b"",
    )
    return replace(blank, snapshot=_learned(blank))


def _learned(world: Arena) -> bytes:
    """Return the snapshot of somebody who saw everything, `_TIMES` over."""
    snapshot = EmpiricalSnapshot(len(world.body.sensors), world.threshold)
    senses, places = Senses(world.body), world.moves.shape[1]
    state = np.zeros(2 * len(world.body.sensors), np.bool_)
    generator = np.random.default_rng(0)
    for _ in range(_TIMES):
        for transition in generator.permutation(world.moves.size).tolist():
            action, before = divmod(transition, places)
            after = int(world.moves[action, before])
            state[: 2 * len(world.fields)] = complete(world.fields[:, before])
            bits = world.sense(after, before)
            snapshot.learn(senses.observe(bits, action, state))
    return snapshot.to_bytes()


def _blocked(
    moves: NDArray[np.intp], coordinates: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Return which actions stay where a neighbour is missing that is within bounds.

    An action is known by where it leads from everywhere else.
    """
    there = {tuple(at) for at in coordinates.tolist()}
    low, high = coordinates.min(axis=0), coordinates.max(axis=0)
    blocked = np.zeros(moves.shape, np.bool_)
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
    cell: ObstacleEntry, world: Arena, run: int, start: int
) -> tuple[int, int, int]:
    """Put an agent down at a place; see `ARRIVED` and so on for what is returned."""
    key = (run, start)
    (seed,) = np.random.SeedSequence(cell.seed, spawn_key=key).generate_state(1)
    policy = new_policy(
        _KINDS[cell.agent],
        world.body,
        int(seed),
        target=cell.goal if cell.agent == "greedy" else (),
        explore=EXPLORE if cell.agent == "excited" else 0.0,
    )
    agent = Agent(world.body, policy, EmpiricalSnapshot.from_bytes(world.snapshot))
    there = world.reached(cell.goal)
    place = before = start
    blocked, first = 0, -1
    for step in range(cell.limit + 1):
        if there[place]:
            return step, blocked, first
        action = agent.act(world.sense(place, before)).action
        first = action if first < 0 else first
        blocked += int(world.blocked[action, place])
        before, place = place, int(world.moves[action, place])
    return -1, blocked, first
