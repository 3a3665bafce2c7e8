"""Policies for tests: fixed values or a graph answer their questions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.policy import Policy, Signal
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.order.graph import PocGraph

Bits = NDArray[np.bool_]


def asked(policy: Policy, tick: int, state: Bits) -> list[Signal]:
    """Return what a policy asks first; nothing if it decides at once."""
    first = next(policy.decide(tick, state), [])
    assert isinstance(first, list)
    return first


def decided(
    policy: Policy, tick: int, state: Bits, answers: Sequence[Bits]
) -> tuple[int, str]:
    """Return what a policy decides that is given these answers, whatever it asks."""
    return answered(policy.decide(tick, state), lambda _: list(answers))


def decided_by(
    graph: PocGraph, policy: Policy, tick: int, state: Bits
) -> tuple[int, str]:
    """Return what a policy decides whose questions a graph answers."""

    def answer(request: object) -> list[Bits]:
        assert isinstance(request, list)
        return [graph.up(one) for one in request]

    return answered(policy.decide(tick, state), answer)
