"""What can be done and what it guarantees, on relations small enough to see through."""

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support.strategies import as_set

ACTIONS = ("forward", "back", "wait")


def literals(body: Body, *names: str) -> set[int]:
    sensorium = Sensorium(body.sensors)
    return {sensorium.literal(name) for name in names}


def array(body: Body, *names: str) -> NDArray[np.bool_]:
    on = np.zeros(2 * len(body.sensors), np.bool_)
    on[list(literals(body, *names))] = True
    return on


def graph(body: Body, *implications: tuple[str, str]) -> PocGraph:
    literal = Sensorium(body.sensors).literal
    pairs = [(literal(a), literal(b)) for a, b in implications]
    return PocGraph.from_implications(len(body.sensors), pairs)


def starfish(*actions: str) -> list[tuple[str, str]]:
    return [(a, f"{b}*") for a in actions for b in actions if a < b]


class TestSignals:
    def test_signals_are_plain_numbers_each_once(self) -> None:
        body = Body.full(["a", "b"], ["x", "y"], exclusive=False)
        for signal in Actions(body).signals(array(body, "a", "b")):
            assert all(type(literal) is int for literal in signal)
            assert len(set(signal)) == len(signal)

    @pytest.mark.parametrize(
        "body",
        [
            Body(own=("a",)),
            Body(own=("a",), senses_actions=True),
            Body(own=("a",), actions=("go",), context=((0, 0),)),
        ],
    )
    def test_a_body_must_sense_what_it_does(self, body: Body) -> None:
        with pytest.raises(
            InvalidValueError, match=r"^agent: must have actions that are sensors, got "
        ):
            Actions(body)


class TestAdmissible:
    def able(self, body: Body, relation: PocGraph, *state: str) -> list[int]:
        repertoire = Actions(body)
        signals = repertoire.signals(array(body, *state))
        possible = repertoire.admissible([relation.up(signal) for signal in signals])
        return possible.nonzero()[0].tolist()

    def test_a_starfish_has_the_pure_actions_and_none(self) -> None:
        # [GK] "Invoking Actions Synchronously".
        body = Body.full(["a"], ACTIONS, exclusive=False)
        relation = graph(body, *starfish(*ACTIONS))
        assert self.able(body, relation, "a") == [0, 0b001, 0b010, 0b100]

    def test_a_context_against_what_an_action_always_does_forbids_it_there(
        self,
    ) -> None:
        # x -> b -> (x&a)*, so x&a -> x* by contraposition.
        body = Body.full(["a", "b"], ["x"], exclusive=False)
        relation = graph(body, ("x", "b"), ("x&a", "b*"))
        assert self.able(body, relation, "a") == [0]

    def test_where_nothing_is_left_the_belief_is_dropped(self) -> None:
        body = Body.full(["a"], ["x", "y"], exclusive=False)
        one = [("x", "y*"), ("x*", "y")]
        relation = graph(body, *one, ("x&a", "x*"), ("y&a", "y*"))
        assert self.able(body, relation, "a*") == [0b01, 0b10]
        assert self.able(body, relation, "a") == [0b00, 0b01, 0b10, 0b11]

    def test_a_pure_action_can_always_be_taken(self) -> None:
        body = Body.full(["a"], ["x", "y"])
        relation = graph(body, ("x&a", "x*"), ("y", "y*"))
        assert self.able(body, relation, "a") == [0, 1]

    def test_that_actions_exclude_each_other_is_learned(self) -> None:
        body = Body(own=("a",), actions=ACTIONS, exclusive=False, senses_actions=True)
        snapshot = EmpiricalSnapshot(Sensorium(body.sensors))
        for tick in range(60):
            taken = [tick % 4 == action for action in range(3)]
            snapshot.observe([tick % 5 < 2, *taken])
        assert self.able(body, snapshot.poc_graph()) == [0, 0b001, 0b010, 0b100]


class TestGuaranteed:
    def test_what_follows_is_guaranteed_unless_its_complement_follows_too(self) -> None:
        body = Body.full(["a", "b", "c"], ["x"])
        relation = graph(body, ("x", "a"), ("x&a", "b"), ("x&c", "b*"))
        bound = guaranteed([relation.up(literals(body, "x", "x&a", "x&c"))])
        assert bound.shape == (1, 2 * len(body.sensors))
        # The contexts contradict each other: x&a -> b -> (x&c)*.
        assert as_set(bound[0]) == literals(body, "x", "a")

    def test_last_steps_sensations_are_not_among_it(self) -> None:
        # The paper's text propagates over the loaded graph, which would keep `better`.
        body = Body.full(["a", "better", "worse"], ["x", "y"], [0, 1, 1])
        state = array(body, "a", "better", "worse*", "y", "x*")
        signals = Actions(body).signals(state)
        relation = graph(body)
        bound = guaranteed([relation.up(signal) for signal in signals])
        assert as_set(bound[0]) == literals(body, "x", "x&a")
        assert as_set(bound[1]) == literals(body, "y", "y&a")
