"""Available actions and their guaranteed effects."""

import numpy as np
import pytest

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support.strategies import as_set


@pytest.mark.parametrize(
    "body",
    [
        Body(own=("a",)),
        Body(own=("a",), senses_actions=True),
        Body(own=("a",), actions=("go",), context=((0, 0),)),
    ],
)
def test_a_body_must_sense_what_it_does(body: Body) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^agent: must have actions that are sensors, got "
    ):
        Actions(body)


class TestGuaranteed:
    def test_last_steps_sensations_are_not_among_it(self) -> None:
        # The paper's text propagates over the loaded graph, which would keep `better`.
        body = Body.full(["a", "better", "worse"], ["x", "y"], [0, 1, 1])
        names = Sensorium(body.sensors)

        def literals(*on: str) -> list[int]:
            return [names.literal(name) for name in on]

        state = np.zeros(2 * len(names), np.bool_)
        state[literals("a", "better", "worse*", "y", "x*")] = True
        relation = PocGraph.from_implications(len(names), [])
        signals = Actions(body).signals(state)
        # Plain numbers, each once.
        assert all(type(literal) is int for signal in signals for literal in signal)
        assert [len(signal) for signal in signals] == [2, 2]
        bound = guaranteed([relation.up(signal) for signal in signals])
        assert [as_set(one) for one in bound] == [
            set(literals("x", "x&a")),
            set(literals("y", "y&a")),
        ]
