"""Which grown sensors retire, held against what was met tick by tick."""

from collections.abc import Callable
from typing import Any

import gymnasium
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.growth.growth import Growth
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.search import Search
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph
from world.minigrid import minigrid
from world.toy_text import cliff_walking


class Watched(Growth):
    """Keeps what was believed when a sensor was looked at."""

    believed: list[PocGraph]

    def _retire(self, snapshot: Snapshot) -> Search[None]:
        self.believed = [snapshot.poc_graph()]
        return super()._retire(snapshot)


def ticks_on(history: History, sensor: int) -> set[int]:
    ring = history.on[:, sensor].tolist()
    return {t for t in range(history.tick) if ring[t // 64] >> t % 64 & 1}


def guarantees(graph: PocGraph, literals: list[int], own: int) -> set[int]:
    up = graph.up(literals)
    return {a for a in range(2 * own) if up[a] and not up[a ^ 1]}


def is_part(one: tuple[int, ...], whole: tuple[int, ...]) -> bool:
    return len(one) < len(whole) and all(literal in whole for literal in one)


def needless(body: Body, place: int, graph: PocGraph, history: History) -> set[str]:
    """Return why a grown sensor is: a part of its context will do, or others will."""
    own, mine = len(body.own), body.first_grown + place
    action, literals = body.grown[place]
    singles = [k for k, (which, _) in enumerate(body.context) if which == action]
    first = body.first_grown - len(body.context)
    grown = [
        other
        for other, (which, _) in enumerate(body.grown)
        if which == action and other != place and other not in body.retired
    ]
    part = [2 * (own + action)]
    part += [2 * (first + k) for k in singles if body.context[k][1] in literals]
    part += [
        2 * (body.first_grown + other)
        for other in grown
        if is_part(body.grown[other][1], literals)
    ]
    alone = guarantees(graph, [2 * mine], own) - guarantees(graph, part, own)
    if not alone:
        return {"part"}
    others = [own + action, *(first + k for k in singles)]
    others += [body.first_grown + other for other in grown]
    was_on = ticks_on(history, mine)
    for result in alone:
        covered: set[int] = set()
        for other in others:
            if result in guarantees(graph, [2 * other], own):
                covered |= ticks_on(history, other)
        if not was_on or not was_on <= covered:
            return set()
    return {"others"}


@pytest.mark.parametrize(
    ("world", "steps"),
    [
        (cliff_walking, 1500),
        (lambda: minigrid(layout="FourRooms"), 1200),
    ],
)
def test_they_are_those_that_others_make_needless(
    world: Callable[[], gymnasium.Env[Any, Any]], steps: int
) -> None:
    env = world()
    agent = Agent.of(env, "walker", grow=True, seed=1)
    growth = Watched(agent.body)
    agent._memory.grow_by(growth)
    why: list[str] = []
    looked = 0

    bits, _ = env.reset(seed=1)
    begins = True
    for _ in range(steps):
        body, growth.believed = agent.body, []
        decision = agent.act(bits, begins)
        if growth.believed and body.grown and growth.history.tick % 8 == 0:
            (graph,) = growth.believed
            place = growth.history.tick // 8 % len(body.grown)
            if place not in body.retired:
                looked += 1
                found = needless(body, place, graph, growth.history)
                assert (decision.retires == body.first_grown + place) == bool(found)
                why += found
        elif decision.retires >= 0:
            raise AssertionError(decision)
        bits, _, over, cut, _ = env.step(decision.action)
        begins = over or cut
        if begins:
            bits, _ = env.reset()
    assert "others" in why
    assert looked > len(why)
