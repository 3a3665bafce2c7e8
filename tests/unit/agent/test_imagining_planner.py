"""Planning several steps ahead: shortest paths, unknown states, reused plans."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.imagining_planner import ImaginingPlanner
from neurosnap.agent.plan import ContingentPlan
from neurosnap.agent.policy import Signal
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.history_questions import Question, answered
from neurosnap.poc.order.graph import PocGraph
from tests.support.agent_oracles import complete, known, view

Bits = NDArray[np.bool_]
PLACES = 8
BODY = Body.full([f"a{k}" for k in range(1, PLACES)], ["forward", "back"])
MOVES = [
    [min(PLACES - 1, x + 1) for x in range(PLACES)],
    [max(0, x - 1) for x in range(PLACES)],
]
FIELDS = [[x < k for x in range(PLACES)] for k in range(1, PLACES)]
GRAPH = known(BODY, MOVES, FIELDS)


def sensed(place: int) -> Bits:
    """Return the state at a place."""
    state = np.zeros(2 * len(BODY.sensors), np.bool_)
    state[list(complete(view(FIELDS, place)))] = True
    return state


def unsure_of(name: str) -> PocGraph:
    """Return the truth without what a sensor guarantees."""
    keep, literal = GRAPH.edges.copy(), 2 * BODY.sensors.index(name)
    keep[literal] = keep[:, literal ^ 1] = False
    return PocGraph(keep)


class Walk:
    """A walk on a path, by one who knows all of it, or has not met some of it."""

    def __init__(
        self,
        goal: int | None,
        graph: PocGraph = GRAPH,
        states: int = 100,
        explore: float = 0.0,
        curious: bool = False,
    ) -> None:
        target = (
            () if goal is None else complete(view(FIELDS, goal))  # the whole of a place
        )
        self.graph = graph
        self.experience = Experience(BODY)
        self.experience.met[:] = True
        curious = curious or goal is None
        self.planner = ImaginingPlanner(
            BODY, target, 1, explore, self.experience, states, curious=curious
        )
        self.asked = 0

    def unmeet(self, names: Iterable[str]) -> None:
        for name in names:
            self.experience.met[2 * BODY.sensors.index(name)] = False

    def decide(self, place: int, tick: int = 1) -> tuple[str, str]:
        def answer(request: list[Signal] | Question) -> list[Bits]:
            assert isinstance(request, list)
            self.asked += len(request)
            return [self.graph.up(signal) for signal in request]

        action, why = answered(self.planner.decide(tick, sensed(place)), answer)
        return BODY.actions[action], why

    def go(self, place: int, steps: int) -> list[int]:
        way = [place]
        for tick in range(steps):
            action, _ = self.decide(way[-1], tick)
            way.append(MOVES[BODY.actions.index(action)][way[-1]])
        return way


@pytest.mark.parametrize("start", range(PLACES))
@pytest.mark.parametrize("goal", range(PLACES))
def test_the_way_is_the_shortest(start: int, goal: int) -> None:
    if start == goal:
        return
    step = 1 if start < goal else -1
    straight = list(range(start, goal + step, step))
    assert Walk(goal).go(start, len(straight) - 1) == straight


def test_a_plan_is_told_and_kept_without_another_wave_until_a_surprise() -> None:
    walk = Walk(5)
    assert walk.decide(2) == ("forward", "in 3: forward, forward, forward")
    asked = walk.asked
    assert walk.decide(3) == ("forward", "in 2: forward, forward")
    assert walk.decide(4) == ("forward", "in 1: forward")
    assert walk.asked == asked > 0
    assert walk.decide(7) == ("back", "in 2: back, back")
    assert walk.asked > asked
    long = f"in 7: {', '.join(['forward'] * 6)}, …"
    assert Walk(7).decide(0) == ("forward", long)  # not told whole


def test_a_round_asks_for_all_states_of_one_distance() -> None:
    deliberation = Walk(3).planner.decide(1, sensed(0))
    rounds: list[Any] = [next(deliberation)]
    with pytest.raises(StopIteration) as end:
        while True:
            closures = [GRAPH.up(signal) for signal in rounds[-1]]
            rounds.append(deliberation.send(closures))
    assert end.value.value == (0, "in 3: forward, forward, forward")
    # From 0 one stays or goes to 1, from there to 2, from there to 3.
    assert [len(one) for one in rounds] == [2, 2, 2]


@pytest.mark.parametrize(
    ("why", "said"),
    [
        ("few states", " among 2 states; guarantees"),
        ("never met", ": nothing tried leads to a3*, a4*, a5*; guarantees"),
        ("an end", ": nothing tried leads to a5*; guarantees"),
    ],
)
def test_where_no_way_can_be_imagined_it_does_what_the_greedy_planner_does(
    why: str, said: str
) -> None:
    walk = Walk(5, states=2 if why == "few states" else 100)
    if why == "never met":
        walk.unmeet(["forward&a4"])
    if why == "an end":
        walk.experience.leave(sensed(4), ends=True)
    assert walk.decide(2)[1].startswith(f"knows no way{said}")
    asked = walk.asked
    walk.decide(2, 2)
    assert walk.asked == asked + 3  # the greedy planner's: there is no other search
    walk.experience.leave(sensed(0), ends=True)  # until anything is learned
    walk.decide(2, 3)
    assert walk.asked > asked + 6
    asked = walk.asked
    walk.decide(1, 4)  # nor is there from what was imagined, if that was all
    assert (walk.asked > asked + 3) == (why == "few states")
    if why == "an end":
        assert walk.decide(3)[0] == "back"  # farther from its target


@pytest.mark.parametrize(
    ("graph", "unmet", "place", "learned", "way"),
    [
        # On at the last place only, and never met.
        (GRAPH, ["back&~a7"], 5, "back", ["forward", "forward", "back"]),
        # It guarantees too little.
        (unsure_of("forward&a2"), [], 3, "forward", ["back", "back", "forward"]),
    ],
)
def test_the_curious_go_to_the_nearest_action_of_which_they_know_too_little(
    graph: PocGraph, unmet: list[str], place: int, learned: str, way: list[str]
) -> None:
    walk = Walk(None, graph)
    for action in [0, 1] * 20:  # what it knew was so, each time that it tried
        walk.experience.surprises[action] += (1, False)
    walk.unmeet(unmet)
    learn = f"to learn what {learned} does there, in 3: {', '.join(way)}"
    assert walk.decide(place) == (way[0], learn)


def test_a_failed_search_is_made_again_once_anything_is_learned() -> None:
    walk = Walk(5)
    walk.unmeet(["forward&a4"])
    hopeless = np.zeros((2, 2 * len(BODY.own)), np.bool_)
    hopeless[1, 0] = True

    def searches() -> bool:
        asked = walk.asked
        walk.decide(2)
        return walk.asked > asked + 3

    assert [searches(), searches()] == [True, False]
    walk.experience.give_up(hopeless)
    assert [searches(), searches()] == [True, False]
    walk.experience.aim()
    assert [searches(), searches()] == [True, False]
    walk.experience.meet(np.ones(2 * len(BODY.sensors), np.bool_))
    assert walk.decide(2) == ("forward", "in 3: forward, forward, forward")


def test_where_chance_led_a_failed_search_is_made_again() -> None:
    walk = Walk(5, unsure_of("forward&a2"), curious=True)
    hopeless = np.zeros((2, 2 * len(BODY.own)), np.bool_)
    hopeless[0, 2 * BODY.own.index("a3") :][:2] = True
    walk.experience.give_up(hopeless)
    walk.unmeet(["back&~a7"])  # on at the last place only
    assert walk.decide(1)[1].startswith("knows no way")  # but there by chance
    learn = "to learn what back does there, in 1: back"
    assert walk.decide(7) == ("back", learn)


def test_what_is_left_to_chance_elsewhere_may_lead_on_from_there() -> None:
    walk = Walk(5)
    walk.unmeet(["forward&a5"])  # so no plan leads on from 4
    walk.decide(2)
    assert len(walk.experience.no_way) > 1
    hopeless = np.zeros((2, 2 * len(BODY.own)), np.bool_)
    hopeless[1, :2] = True
    walk.experience.give_up(hopeless)
    walk.decide(2)
    assert len(walk.experience.no_way) == 1


def test_the_greedy_planner_ends_an_episode_at_its_target_only() -> None:
    walk = Walk(5)
    walk.unmeet(["forward&a5"])  # so no plan leads on from 4
    walk.experience.leave(sensed(5), ends=True)
    assert walk.decide(4)[0] == "forward"


def test_with_a_target_what_is_left_to_chance_is_not_for_learning() -> None:
    # Whether to go forward leads from 1 to 2.
    walk = Walk(5, unsure_of("forward&a2"), curious=True)
    walk.unmeet(["forward&~a2"])  # only on from 2 on
    learn = "to learn what forward does there, in 1: forward"
    assert walk.decide(1) == ("forward", learn)

    walk.experience.aim()
    hopeless = np.zeros((2, 2 * len(BODY.own)), np.bool_)
    hopeless[0, 2 * BODY.own.index("a3") :][:2] = True
    walk.experience.give_up(hopeless)
    walk.experience.leave(sensed(0), ends=True)
    action, why = walk.decide(1)
    assert action == "forward"
    assert "; guarantees" in why  # by luck, and no other episode is begun
    walk.experience.leave(sensed(0), ends=False)
    walk.unmeet(["back&a1"])  # only on at the first place
    learn = "to learn what back does there, in 2: back, back"
    assert walk.decide(1) == ("back", learn)  # what can be learned still is


def test_nothing_done_at_random_is_foreseen_to_end_the_episode() -> None:
    walk = Walk(5, explore=1.0)
    walk.experience.leave(sensed(1), ends=True)
    assert {walk.decide(2, tick)[0] for tick in range(40)} == {"forward"}
    walk.experience.leave(sensed(3), ends=True)
    assert {walk.decide(2, tick)[0] for tick in range(40)} == {"forward", "back"}


def test_a_share_of_actions_is_random() -> None:
    walk, random = Walk(5, explore=0.5), 0
    for tick in range(0, 400, 2):
        walk.decide(2, tick)
        if walk.decide(2, tick + 1)[1] == "at random, to explore":
            random += 1
            assert walk.experience.plan is None  # it may have led anywhere
    assert 60 < random < 140


@pytest.mark.parametrize(("why", "some"), [("guesses", True), ("arrives", False)])
def test_one_that_guesses_may_go_in_circles_and_does_a_share_at_random(
    why: str, some: bool
) -> None:
    walk, random = Walk(5), 0
    forward = np.zeros(1, np.intp)
    ways = forward[:, None] - 1, np.zeros((1, 1))
    literals = np.zeros((1, 2 * len(BODY.sensors)), np.bool_)
    plan = ContingentPlan(forward, literals, why, np.ones(1), 10**6, *ways)
    for tick in range(300):
        walk.experience.plan = plan
        random += walk.decide(2, tick + 1)[1].startswith("at random")
        assert walk.experience.plan is plan
    assert (0.1 < random / 300 < 0.3) == some
    assert (random == 0) != some


@pytest.mark.parametrize(
    ("states", "target", "rule"),
    [
        (0, ["a1"], "imagine: must be 1 or more, got 0"),
        (9, [], "target: must name a sensation to achieve, or come with explor"),
        (9, ["b"], "literal: must name a sensor that exists, got 'b'"),
    ],
)
def test_what_cannot_be_is_refused(states: int, target: list[str], rule: str) -> None:
    body = Body.full(["a1"], ["go", "turn"])
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        ImaginingPlanner(body, target, 0, 0.0, Experience(body), states)
