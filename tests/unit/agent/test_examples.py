"""The paper's examples of acting, with relations known and not learned.

The truth is found by looking at every action at every place.
"""

import functools

import pytest

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner, subgoals
from neurosnap.agent.policy import Policy
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support import agent_oracles as agents
from tests.support.agent_oracles import Fields, Moves, as_array, known
from tests.support.deliberations import decided_by
from tests.support.strategies import as_set


def promised(body: Body, graph: PocGraph, now: set[int]) -> list[set[int]]:
    signals = Actions(body).signals(as_array(now, graph.sensors))
    return [as_set(one) for one in guaranteed([graph.up(one) for one in signals])]


LENGTH = 5  # the paper's figure of the path with motion


def path(places: int) -> tuple[Body, Moves, Fields]:
    """[GK] example:path with motion: ``a_k`` is on iff the place is below `k`."""
    last, own = places - 1, [f"a{k}" for k in range(1, places)]
    moves = [
        [min(last, x + 1) for x in range(places)],
        [max(0, x - 1) for x in range(places)],
        list(range(places)),
    ]
    fields = [[x < k for x in range(places)] for k in range(1, places)]
    return Body.full(own, ["forward", "back", "wait"]), moves, fields


def cycle(places: int) -> tuple[Body, Moves, Fields]:
    """[GK] "Agent on a Circular Rail": a beacon is on at its place and next to it."""
    own = [f"near{k}" for k in range(places)]
    moves = [
        [(x + 1) % places for x in range(places)],
        [(x - 1) % places for x in range(places)],
    ]
    fields = [
        [(x - k) % places in (0, 1, places - 1) for x in range(places)]
        for k in range(places)
    ]
    return Body.full(own, ["forward", "back"]), moves, fields


class TestDiscretePathWithMotion:
    """[GK] "Example: discrete path with motion", and the same revisited."""

    body, moves, fields = path(LENGTH + 1)
    names = Sensorium(body.sensors)

    @functools.cached_property
    def graph(self) -> PocGraph:
        return known(self.body, self.moves, self.fields)

    def test_without_context_the_relations_are_the_papers_and_no_others(self) -> None:
        own, actions = self.body.own, self.body.actions
        bare = Body(own=own, actions=actions, senses_actions=True)
        literal = Sensorium(bare.sensors).literal
        generators = [
            *((f"a{k}", f"a{k + 1}") for k in range(1, LENGTH)),
            *[("forward", "back*"), ("back", "wait*"), ("wait", "forward*")],
            *[("forward", "a1*"), ("back", f"a{LENGTH}")],
        ]
        count = len(bare.sensors)
        papers = PocGraph.from_implications(
            count, [(literal(a), literal(b)) for a, b in generators]
        )
        true = known(bare, self.moves, self.fields)
        for a in range(2 * count):
            for b in range(2 * count):
                assert papers.leq(a, b) == true.leq(a, b), (a, b)

    @pytest.mark.parametrize("place", range(LENGTH + 1))
    @pytest.mark.parametrize("choice", range(3))
    def test_what_is_guaranteed_is_all_of_the_place_that_is_reached(
        self, place: int, choice: int
    ) -> None:
        now = agents.complete(agents.view(self.fields, place))
        promise = promised(self.body, self.graph, now)[choice]
        happens = agents.happens(self.body, self.moves, self.fields, place, choice)
        assert promise <= happens
        position = agents.position(self.body)
        assert promise & position == happens & position

    @pytest.mark.parametrize("goal", range(2 * LENGTH))
    def test_the_planner_walks_straight_to_any_half_of_the_path(
        self, goal: int
    ) -> None:
        halves = [
            x
            for x in range(LENGTH + 1)
            if goal in agents.complete(agents.view(self.fields, x))
        ]
        policy = Planner(self.body, [goal], seed=1, explore=0.0)
        for start in range(LENGTH + 1):
            walked = self.walk(policy, start, 3 * LENGTH)
            distance = min(abs(start - x) for x in halves)
            step = 1 if start < halves[0] else -1
            straight = [start + step * k for k in range(distance + 1)]
            # Once there it waits: no other action keeps all that it has.
            assert walked == straight + [straight[-1]] * (3 * LENGTH - distance)

    def walk(self, policy: Policy, start: int, steps: int) -> list[int]:
        walked = [start]
        for tick in range(1, steps + 1):
            now = as_array(
                agents.complete(agents.view(self.fields, walked[-1])),
                self.graph.sensors,
            )
            action, _ = decided_by(self.graph, policy, tick, now)
            walked.append(self.moves[action][walked[-1]])
        return walked


class TestCircularRail:
    """[GK] "Example: Agent on a Circular Rail"."""

    places = 8
    body, moves, fields = cycle(places)
    names = Sensorium(body.sensors)

    @functools.cached_property
    def graph(self) -> PocGraph:
        return known(self.body, self.moves, self.fields)

    def near(self, *places: int) -> set[int]:
        return {2 * (place % self.places) for place in places}

    def test_the_relations_among_beacons_are_the_papers(self) -> None:
        for i in range(self.places):
            for j in range(self.places):
                far = min((i - j) % self.places, (j - i) % self.places) > 2
                assert self.graph.leq(2 * i, 2 * j + 1) == far
                assert self.graph.leq(2 * i, 2 * j) == (i == j)

    @pytest.mark.parametrize("place", range(8))
    def test_what_is_guaranteed_has_the_neighbouring_beacons(self, place: int) -> None:
        now = agents.complete(agents.view(self.fields, place))
        forward, back = promised(self.body, self.graph, now)
        assert self.near(place, place + 1, place + 2) <= forward
        assert self.near(place - 2, place - 1, place) <= back
        for choice, promise in enumerate((forward, back)):
            happens = agents.happens(self.body, self.moves, self.fields, place, choice)
            assert promise <= happens

    def test_the_plan_wants_to_cross_the_circle_where_there_is_no_way(self) -> None:
        # U_3 and U_9 meet neither U_0 nor U_6 and separate 0 from 6, so the plan wants
        # both to stay off; yet one of them is on somewhere on either way.
        places = 12
        body, moves, fields = cycle(places)
        graph = known(body, moves, fields)
        now = agents.complete(agents.view(fields, 0))
        plan = subgoals(as_array(now, graph.sensors), graph.up([2 * 6]))
        between = {2 * 3 + 1, 2 * 9 + 1}
        assert between <= as_set(plan)
        for side in (range(7), [0, *range(11, 5, -1)]):
            views = [agents.complete(agents.view(fields, x)) for x in side]
            assert not all(between <= view for view in views)
