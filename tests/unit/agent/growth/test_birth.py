"""Sensors that are grown by a script: which there may be, and when they come."""

import re
from typing import Any

import msgspec
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.growth.birth import Birth, with_births
from neurosnap.errors import InvalidValueError
from tests.support.lamp import Lamp
from world.toy_text import frozen_lake

BODY = Body.full(["a", "b", "moved"], ["x", "y"], [0, 0, 1])


def test_there_is_room_for_them_besides_what_the_agent_may_grow() -> None:
    births = [Birth("y", ("b*", "a"), 7), Birth("x", ("a*", "b*"))]
    body = with_births(Body.full(["a", "b"], ["x", "y"], room=2), births)
    assert (body.room, body.finds) == (4, 2)
    # One of tick 0 is there from the start.
    assert body.grown == ((0, (1, 3)),)
    assert body.sensors[body.first_grown :] == (
        *("x&~a&~b", "grown 2", "grown 3", "grown 4"),
    )
    assert body.awaited == [(7, (1, (0, 3)))]
    assert body.grow((1, (0, 3))).awaited == []


@pytest.mark.parametrize(
    ("literals", "said"),
    [
        (
            "a c*",
            "[1]: must name a sensor of the world's own, or one with a star, got 'c*'",
        ),
        ("a moved", "[1]: must be of a sensor that looks back no step, got 'moved'"),
        ("a b a*", "[2]: must not be the complement of another one, got 'a*'"),
        ("a a", ": must be of two sensors or more, got ('a', 'a')"),
        ("b* a*", ": must be another sensor than births[0], got ('b*', 'a*')"),
    ],
)
def test_what_cannot_be_grown_is_refused(literals: str, said: str) -> None:
    births = [Birth("x", ("a*", "b*")), Birth("x", tuple(literals.split()), 5)]
    with pytest.raises(InvalidValueError, match=re.escape(f"births[1].literals{said}")):
        with_births(BODY, births)
    with pytest.raises(
        InvalidValueError, match=r"births\[0\].action: must be one of x, y"
    ):
        with_births(BODY, [Birth("z", ("a", "b"))])
    with pytest.raises(InvalidValueError, match=r"^births: must go with a planner or"):
        with_births(Body(own=("a", "b"), actions=("x",)), births)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"room": 1}, "scripted: must be at most 1, for which there is room, got 2"),
        ({"room": 2}, "scripted: must be different"),
        ({"scripted": ((-1, (0, (0, 2))),)}, "scripted: must be at ticks from 0 up"),
        ({"scripted": ((1, (0, (0,))),)}, "scripted: must be of literals of two or"),
    ],
)
def test_a_body_has_no_script_that_it_cannot_follow(
    more: dict[str, Any], said: str
) -> None:
    given = {"scripted": ((1, (0, (0, 2))),) * 2, "room": 9, **more}
    with pytest.raises(InvalidValueError, match=f"^{re.escape(said)}"):
        msgspec.structs.replace(Body.full(["a", "b"], ["x"]), **given)


def births_of(agent: Agent, steps: int) -> dict[int, str]:
    """Return what an agent grows in a while, by tick."""
    env, found = Lamp(), {}
    bits = env.reset(seed=0)[0]
    for tick in range(1, steps + 1):
        decision = agent.act(bits)
        if decision.born >= 0:
            found[tick] = agent.body.sensors[decision.born]
        bits = env.step(decision.action)[0]
    return found


def test_they_come_at_their_ticks_one_at_a_tick_and_are_never_retired() -> None:
    births = [
        Birth("press", ("lit", "a"), 5),
        Birth("turn_a", ("a", "b"), 3),
        Birth("press", ("a", "b"), 5),
        Birth("turn_b", ("a", "b")),
    ]
    agent = Agent.of(Lamp(), "planner", target=["lit"], explore=0.5, births=births)
    assert agent.body.sensors[agent.body.first_grown] == "turn_b&a&b"
    grown = {3: "turn_a&a&b", 5: "press&a&lit", 6: "press&a&b"}
    assert births_of(agent, 300) == grown
    # Some of them guarantee nothing that a part of them does not.
    assert agent.body.retired == ()
    literal = agent.snapshot.sensorium.literal
    graph = agent.snapshot.poc_graph()
    assert graph.leq(literal("press&a&b"), literal("lit"))
    assert not graph.leq(literal("press&a"), literal("lit"))


def test_what_is_scripted_is_not_found_as_well() -> None:
    given: dict[str, Any] = {"imagine": True, "explore": 0.5, "seed": 3}
    found = Agent.of(Lamp(), "planner", grow=2, **given)
    assert "press&a&b" in births_of(found, 200).values()
    script = [Birth("press", ("a", "b"), 150)]
    told = Agent.of(Lamp(), "planner", grow=2, births=script, **given)
    births = births_of(told, 200)
    assert [tick for tick, name in births.items() if name == "press&a&b"] == [150]


def test_the_agent_finds_no_more_than_it_may() -> None:
    births = [Birth("up", ("row<1", "column<1")), Birth("up", ("row<1", "row<2"), 9)]
    env = frozen_lake()
    agent = Agent.of(env, "planner", grow=2, imagine=True, births=births)
    agent.learn(env, 400)
    assert len(agent.body.grown) == agent.body.room == 4
    assert {context for _, context in agent.body.scripted} <= set(agent.body.grown)
