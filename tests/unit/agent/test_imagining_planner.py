"""Planning by imagined waves: shortest ways, the unknown, and plans that are kept."""

import re
from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import BEGINNING, Experience
from neurosnap.agent.imagining_planner import ImaginingPlanner
from neurosnap.agent.policy import Signal, decided
from neurosnap.errors import InvalidValueError
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
        state = np.zeros(2 * len(BODY.sensors), np.bool_)
        state[list(complete(view(FIELDS, place)))] = True

        def closure(signal: Signal) -> Bits:
            self.asked += 1
            return self.graph.up(signal)

        action, why = decided(self.planner.decide(tick, state), closure)
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


def test_a_plan_is_told_and_kept_without_another_wave() -> None:
    walk = Walk(5)
    assert walk.decide(2) == ("forward", "in 3: forward, forward, forward")
    asked = walk.asked
    assert walk.decide(3) == ("forward", "in 2: forward, forward")
    assert walk.decide(4) == ("forward", "in 1: forward")
    assert walk.asked == asked > 0


def test_a_surprise_makes_another_plan() -> None:
    walk = Walk(5)
    walk.decide(2)
    asked = walk.asked
    assert walk.decide(7) == ("back", "in 2: back, back")
    assert walk.asked > asked


def test_a_long_plan_is_not_told_whole() -> None:
    _, why = Walk(7).decide(0)
    assert why == f"in 7: {', '.join(['forward'] * 6)}, …"


def test_a_round_asks_for_all_states_of_one_distance() -> None:
    planner = Walk(3).planner
    state = np.zeros(2 * len(BODY.sensors), np.bool_)
    state[list(complete(view(FIELDS, 0)))] = True
    deliberation = planner.decide(1, state)
    rounds = [next(deliberation)]
    with pytest.raises(StopIteration) as end:
        while True:
            closures = [GRAPH.up(signal) for signal in rounds[-1]]
            rounds.append(deliberation.send(closures))
    assert end.value.value == (0, "in 3: forward, forward, forward")
    # From 0 one stays or goes to 1, from there to 2, from there to 3.
    assert [len(one) for one in rounds] == [2, 2, 2]


def test_with_too_few_states_it_does_what_the_greedy_planner_does() -> None:
    action, why = Walk(7, states=2).decide(0)
    assert action == "forward"
    assert why.startswith("guarantees")


def test_an_action_whose_contexts_were_not_met_is_not_imagined() -> None:
    walk = Walk(5)
    walk.unmeet(["forward&a4"])
    _, why = walk.decide(3)
    assert why.startswith(("guarantees", "at random"))


def calm(walk: Walk) -> None:
    """Let what it knew have been so, each time that it tried."""
    for action in range(2):
        for _ in range(20):
            walk.experience.surprises.count(action, False)


def test_the_curious_go_to_the_nearest_action_they_know_nothing_of() -> None:
    walk = Walk(None)
    calm(walk)
    walk.unmeet(["back&~a7"])  # only on at the last place
    assert walk.decide(5) == (
        "forward",
        "to learn what back does there, in 3: forward, forward, back",
    )


def test_the_curious_go_to_the_nearest_action_that_guarantees_too_little() -> None:
    keep = GRAPH.edges.copy()
    unsure = 2 * BODY.sensors.index("forward&a2")
    keep[unsure] = keep[:, unsure ^ 1] = False
    walk = Walk(None, PocGraph(keep))
    calm(walk)
    action, why = walk.decide(3)
    assert (action, why) == (
        "back",
        "to learn what forward does there, in 3: back, back, forward",
    )


def ending(walk: Walk, place: int, ends: bool = True) -> None:
    """Let an episode end at a place, or not any more."""
    here = np.zeros(2 * len(BODY.sensors), np.bool_)
    here[list(complete(view(FIELDS, place)))] = True
    walk.experience.leave(here, ends=ends)


def first_words(walk: Walk, ticks: int = 40) -> set[str]:
    """What it is up to at a place, at many ticks."""
    found = set()
    for tick in range(ticks):
        walk.experience.plan = None
        found.add(walk.decide(3, tick)[1].split(",")[0])
    return found


def test_with_a_target_what_is_left_to_chance_is_not_for_learning() -> None:
    keep = GRAPH.edges.copy()
    unsure = 2 * BODY.sensors.index("forward&a2")  # whether it leads from 1 to 2
    keep[unsure] = keep[:, unsure ^ 1] = False
    walk = Walk(5, PocGraph(keep), curious=True)
    walk.unmeet(["forward&~a2"])  # only on from 2 on
    learn = "to learn what forward does there, in 1: forward"
    assert walk.decide(1) == ("forward", learn)

    walk.experience.aim()
    hopeless = np.zeros((2, 2 * len(BODY.own)), np.bool_)
    hopeless[0, 2 * BODY.own.index("a3") :][:2] = True
    walk.experience.give_up(hopeless)
    ending(walk, 0)
    action, why = walk.decide(1)
    assert action == "forward"
    assert why.startswith("guarantees")  # by luck, and no other episode is begun
    ending(walk, 0, ends=False)
    walk.unmeet(["back&a1"])  # only on at the first place
    learn = "to learn what back does there, in 2: back, back"
    assert walk.decide(1) == ("back", learn)  # what can be learned still is


def test_where_all_is_known_the_curious_do_what_surprised_most_before() -> None:
    walk = Walk(None)
    forward, back = (f"to test what {name} does there" for name in ("forward", "back"))
    assert first_words(walk) == {forward, back}
    ending(walk, 1)
    assert first_words(walk) == {forward, back}  # they are nearer
    surprises = walk.experience.surprises
    for _ in range(20):
        surprises.count(0, False)
    assert first_words(walk) == {back}
    calm(walk)
    assert first_words(walk) == {"to begin another episode"}
    for _ in range(200):
        surprises.count(BEGINNING, False)
    assert first_words(walk) == {back}
    ending(walk, 1, ends=False)
    assert first_words(walk) == {back}


def tried(walk: Walk, place: int, action: int) -> None:
    here = np.zeros(2 * len(BODY.sensors), np.bool_)
    here[list(complete(view(FIELDS, place)))] = True
    walk.experience.leave(here, ends=False, action=action)


def test_tests_are_of_the_nearest_outcome_never_seen_then_of_any() -> None:
    walk = Walk(None)
    for place in range(PLACES):
        for action in range(2):
            if (place, action) != (4, 1):
                tried(walk, place, action)
    assert walk.decide(2) == (
        "forward",
        "to test what back does there, in 3: forward, forward, back",
    )
    tried(walk, 4, 1)
    lengths = set()
    for tick in range(200):
        walk.experience.plan = None
        lengths.add(int(walk.decide(0, tick)[1].split(" in ")[1].split(":")[0]))
    assert lengths == set(range(1, PLACES + 1))


def test_who_wants_something_tests_nothing_and_ends_the_episode() -> None:
    walk = Walk(5)
    walk.planner._curious = True
    ending(walk, 4)
    ending(walk, 1)
    assert first_words(walk) == {"to begin another episode"}


def test_no_way_leads_through_the_end_of_an_episode() -> None:
    walk = Walk(5)
    place = np.zeros(2 * len(BODY.sensors), np.bool_)
    place[list(complete(view(FIELDS, 4)))] = True
    walk.experience.leave(place, ends=True)
    _, why = walk.decide(2)
    assert why.startswith(("guarantees", "at random"))


def test_a_share_of_actions_is_random() -> None:
    walk = Walk(5, explore=0.5)
    told = [walk.decide(2, tick)[1] for tick in range(200)]
    assert 60 < sum(why == "at random, to explore" for why in told) < 140


@pytest.mark.parametrize(
    ("states", "curious", "target", "rule"),
    [
        (0, False, ["a1"], "imagine: must be 1 or more, got 0"),
        (9, False, [], "target: must name a sensation to achieve, or come with explor"),
        (9, False, ["b"], "literal: must name a sensor that exists, got 'b'"),
    ],
)
def test_what_cannot_be_is_refused(
    states: int, curious: bool, target: list[str], rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        ImaginingPlanner(
            BODY, target, 0, 0.0, Experience(BODY), states, curious=curious
        )


def test_actions_must_exclude_each_other() -> None:
    body = Body.full(["a"], ["go", "turn"], exclusive=False)
    with pytest.raises(InvalidValueError, match=r"^imagine: must come with actions"):
        ImaginingPlanner(body, ["a"], 0, 0.0, Experience(body))
