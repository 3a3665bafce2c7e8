"""The sensors that retire are those computed from the history at every tick."""

import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.growth import Growth, is_needless
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.poc.learning.history_questions import Search, answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.order.graph import PocGraph
from world.toy_text import cliff_walking


class Watched(Growth):
    """Keeps what was believed when a sensor was looked at."""

    believed: list[PocGraph]

    def _retire(self, graph: PocGraph) -> Search[None]:
        self.believed = [graph]
        return super()._retire(graph)


def ticks_on(history: History, sensor: int) -> set[int]:
    ring, length = history.on[:, sensor].tolist(), history.length
    held = range(max(0, history.tick - length), history.tick)
    return {t for t in held if ring[t // 64 % (length // 64)] >> t % 64 & 1}


def guarantees(graph: PocGraph, literals: list[int], own: int) -> set[int]:
    up = graph.up(literals)
    return {a for a in range(2 * own) if up[a] and not up[a ^ 1]}


def needless(
    body: Body, place: int, graph: PocGraph, history: History, ever: set[int]
) -> set[str]:
    """Return why a grown sensor is: a part of its context will do, or others will.

    Others will not where they may be missing at ticks that are `forgotten`: of those
    at which it was `ever` on, some are no longer in the history.
    """
    own, mine = len(body.own), body.first_grown + place
    action, literals, *_ = body.grown[place]
    singles = [k for k, (which, _) in enumerate(body.context) if which == action]
    first = body.first_grown - len(body.context)
    grown = [
        other
        for other, (which, *_) in enumerate(body.grown)
        if which == action and other != place and other not in body.retired
    ]
    part = [2 * (own + action)]
    part += [2 * (first + k) for k in singles if body.context[k][1] in literals]
    part += [
        2 * (body.first_grown + other)
        for other in grown
        if {*body.grown[other][1]} < {*literals}
    ]
    alone = guarantees(graph, [2 * mine], own) - guarantees(graph, part, own)
    if not alone:
        return {"part"}
    others = [own + action, *(first + k for k in singles)]
    others += [body.first_grown + other for other in grown]
    was_on = ticks_on(history, mine)
    others_do = bool(was_on)
    for result in alone:
        covered: set[int] = set()
        for other in others:
            if result in guarantees(graph, [2 * other], own):
                covered |= ticks_on(history, other)
        others_do &= was_on <= covered
    if others_do and was_on < ever:
        return {"forgotten"}
    return {"others"} if others_do else set()


def test_they_are_those_that_others_make_needless() -> None:
    env = cliff_walking()
    agent = Agent.of(env, "walker", grow=True, seed=1)
    growth = Watched(agent.body)
    growth.history = History(len(agent.body.sensors), 256)
    agent._mind.memory._growth = growth
    why: list[str] = []
    ever: dict[int, set[int]] = {}  # ticks at which each grown sensor was on
    looked = 0

    bits, _ = env.reset(seed=1)
    begins = True
    for _ in range(450):
        body, growth.believed = agent.body, []
        decision = agent.act(bits, begins)
        last = growth.history.tick - 1
        word = growth.history.on[last // 64 % 4].tolist()
        for sensor in range(body.first_grown, len(agent.body.sensors)):
            if sensor == decision.born or sensor not in ever:  # with its past
                ever[sensor] = ticks_on(growth.history, sensor)
            elif word[sensor] >> last % 64 & 1:
                ever[sensor].add(last)
        if growth.believed and body.grown and growth.history.tick % 8 == 0:
            (graph,) = growth.believed
            place = growth.history.tick // 8 % len(body.grown)
            if place not in body.retired:
                looked += 1
                mine = body.first_grown + place
                found = needless(
                    body, place, graph, growth.history, ever.get(mine, set())
                )
                retires = bool(found - {"forgotten"})
                assert (decision.retires == mine) == retires
                why += found
        elif decision.retires >= 0:
            raise AssertionError(decision)
        bits, _, over, cut, _ = env.step(decision.action)
        begins = over or cut
        if begins:
            bits, _ = env.reset()
    assert {"others", "forgotten"} <= set(why)
    assert looked > len(why)


@pytest.mark.parametrize(
    ("believed", "needless"),
    [
        ([("short", "c"), ("long", "c")], (False, True)),
        ([("long", "c")], (True, False)),
        ([("a", "c"), ("short", "c"), ("long", "c")], (True, True)),
        ([("short", "ago*"), ("long", "ago*")], (False, True)),
        ([], (True, True)),
    ],
)
def test_a_window_is_needless_if_a_part_of_it_will_do(
    believed: list[tuple[str, str]], needless: tuple[bool, bool]
) -> None:
    body = Body(own=("a", "b", "c"), room=3)
    for context in (
        Context(-1, (0,), since=1),
        Context(-1, (0,), since=3),
        Context(-1, (2,), since=3, until=3),
    ):
        body = body.grow(context)
    literal = {"a": 0, "c": 4, "short": 6, "long": 8, "ago*": 11}
    always = [("short", "a"), ("long", "a"), ("long", "short")]
    edges = [(literal[a], literal[b]) for a, b in (*always, *believed)]
    graph = PocGraph.from_implications(len(body.sensors), edges)
    answer = History(len(body.sensors), 64).answer
    found = [
        answered(is_needless(body, place, graph, 0, 0), answer) for place in (0, 1)
    ]
    assert tuple(found) == needless


def test_one_that_retired_makes_no_other_needless() -> None:
    body = Body.full(["a", "b", "c", "hit"], ["go"], room=2)
    body = body.grow(Context(0, (0, 2))).grow(Context(0, (0, 2, 4)))
    first, hit = 2 * body.first_grown, 2 * body.own.index("hit")
    graph = PocGraph.from_implications(
        len(body.sensors), [(first, hit), (first + 2, hit)]
    )
    for one, needless in ((body, True), (body.retire(0), False)):
        search = is_needless(one, 1, graph, 0, 64)
        answer = History(len(body.sensors), 64).answer
        assert answered(search, answer) == needless
