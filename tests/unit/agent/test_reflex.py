"""Greedy planning that remembers where nothing led nearer."""

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.planner import Planner, Reflex
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium, complete
from tests.support.deliberations import decided_by

# A corridor of six places, of which each is sensed. The goal looks alike its far end in
# two of three sensors, so that greedily one goes there, and stays.
SENSORS = ("p0", "p1", "p2", "p3", "p4", "p5", "u", "v")
ON = {0: ("u", "v"), 5: ("u", "v")}
BODY = Body.full(SENSORS, ["back", "forward"])
NAMES = Sensorium(BODY.sensors)


def reading(place: int) -> set[str]:
    return {f"p{place}", *ON.get(place, ())}


def literals(place: int) -> list[str]:
    return [name if name in reading(place) else f"{name}*" for name in SENSORS]


def corridor() -> PocGraph:
    """Return what follows from each action at each place."""
    found = []
    for place in range(6):
        for action, step in (("back", -1), ("forward", 1)):
            after = min(5, max(0, place + step))
            context = NAMES.literal(f"{action}&p{place}")
            found += [(context, NAMES.literal(name)) for name in literals(after)]
    return PocGraph.from_implications(len(NAMES), found)


GRAPH = corridor()


def steps(policy: Planner, place: int, most: int = 40) -> int:
    """Return the steps it takes to the far end; `most` if it does not arrive."""
    for tick in range(most):
        if place == 5:
            return tick
        state = np.zeros(2 * len(NAMES), np.bool_)
        own = np.array([name in reading(place) for name in SENSORS])
        state[: 2 * len(SENSORS)] = complete(own)
        action, _ = decided_by(GRAPH, policy, tick, state)
        place = min(5, max(0, place + (-1, 1)[action]))
    return most


TARGET = ["p5", "u", "v"]


def test_where_greed_stays_for_ever_it_leaves() -> None:
    assert steps(Planner(BODY, TARGET, 0, explore=0.0), 1) == 40
    experience = Experience(BODY)
    taken = [steps(Reflex(BODY, TARGET, 0, experience), 1) for _ in range(30)]
    assert taken[0] < 40
    assert experience.raised
    # What it has raised by then it need not raise again: the way is the shortest.
    assert taken[-1] == 4


def test_where_greed_arrives_it_does_the_same() -> None:
    assert steps(Planner(BODY, TARGET, 0, explore=0.0), 4) == 1
    assert steps(Reflex(BODY, TARGET, 0, Experience(BODY)), 4) == 1


def test_what_is_raised_is_remembered_and_forgotten_for_another_target() -> None:
    experience = Experience(BODY)
    steps(Reflex(BODY, TARGET, 0, experience), 1)
    again = Experience(BODY)
    again.restore(experience.arrays())
    assert list(again.raised.items()) == list(experience.raised.items())
    again.aim()
    assert again.raised == {}
