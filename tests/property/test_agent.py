"""Agents behave like a reference implementation in random worlds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.planner import subgoals
from neurosnap.poc.order.graph import PocGraph
from tests.support import agent_oracles as agents
from tests.support.agent_oracles import Fields, Moves, as_array, known
from tests.support.edges import edges_of
from tests.support.hypothesis_settings import examples
from tests.support.strategies import as_set, bit_rows, graphs, subsets


@st.composite
def bodies(draw: st.DrawFn) -> Body:
    own = draw(st.integers(1, 2))
    actions = draw(st.integers(1, 3))
    pairs = [(action, a) for action in range(actions) for a in range(2 * own)]
    context = draw(st.lists(st.sampled_from(pairs), unique=True, max_size=4))
    return Body(
        own=tuple(f"s{k}" for k in range(own)),
        actions=tuple(f"a{k}" for k in range(actions)),
        senses_actions=True,
        context=tuple(context),
    )


@st.composite
def beliefs(draw: st.DrawFn, body: Body) -> tuple[PocGraph, set[int]]:
    """Draw a relation on a body's sensors, and a coherent state."""
    count = len(body.sensors)
    small = draw(graphs(most=count))
    place = draw(st.permutations(range(count)))
    graph = PocGraph.from_implications(
        count,
        [
            (2 * place[a // 2] + a % 2, 2 * place[b // 2] + b % 2)
            for a, b in edges_of(small.edges)
        ],
    )
    return graph, as_set(graph.coherent_projection(draw(subsets(graph))))


class TestAnyBelief:
    @pytest.mark.slow
    @given(st.data())
    def test_signals_and_consequences(self, data: st.DataObject) -> None:
        body = data.draw(bodies())
        graph, state = data.draw(beliefs(body))
        edges = edges_of(graph.edges)
        signals = Actions(body).signals(as_array(state, graph.sensors))
        actions = range(len(body.actions))
        expected = [agents.signal(body, action, state) for action in actions]
        assert [set(one) for one in signals] == expected
        closures = [graph.up(one) for one in signals]
        assert [as_set(one) for one in guaranteed(closures)] == [
            agents.bound(edges, one) for one in expected
        ]

    @given(st.data())
    def test_the_plan_is_the_reduced_target_propagated(
        self, data: st.DataObject
    ) -> None:
        graph = data.draw(graphs())
        edges = edges_of(graph.edges)
        state = graph.coherent_projection(data.draw(subsets(graph)))
        target = data.draw(subsets(graph))
        plan = subgoals(state, graph.up(target))
        reduced = graph.coherent_projection(target)
        assert as_set(plan) == as_set(graph.propagate(state, reduced))
        assert as_set(plan) == agents.plan(edges, as_set(state), target)
        assert graph.is_coherent(plan)
        if graph.is_coherent(target):
            assert target <= as_set(plan)


@st.composite
def worlds(draw: st.DrawFn) -> tuple[Body, Moves, Fields]:
    """Draw places with moves and fields, and a body with some of the contexts."""
    body = draw(bodies())
    places = draw(st.integers(1, 4))
    place = st.integers(0, places - 1)
    row = st.lists(place, min_size=places, max_size=places)
    field = bit_rows(places)
    count, own = len(body.actions), len(body.own)
    moves = draw(st.lists(row, min_size=count, max_size=count))
    fields = draw(st.lists(field, min_size=own, max_size=own))
    return body, moves, fields


@examples(60)
@given(worlds())
def test_what_is_guaranteed_by_the_truth_happens(
    world: tuple[Body, Moves, Fields],
) -> None:
    body, moves, fields = world
    graph = known(*world)
    for place in range(len(moves[0])):
        # What the last step was has no say in what the next one leads to.
        now = agents.complete(agents.view(fields, place))
        signals = Actions(body).signals(as_array(now, graph.sensors))
        promises = guaranteed([graph.up(one) for one in signals])
        for action, promise in enumerate(promises):
            assert as_set(promise) <= agents.happens(body, moves, fields, place, action)
