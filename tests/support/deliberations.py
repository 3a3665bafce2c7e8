"""Test policies whose questions are answered by fixed values or by a graph."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.policy import Deliberation, Policy, Signal
from neurosnap.poc.order.graph import PocGraph

Bits = NDArray[np.bool_]


def asked(policy: Policy, tick: int, state: Bits) -> list[Signal]:
    """Return what a policy asks first; nothing if it decides at once."""
    return next(policy.decide(tick, state), [])


def decided(
    policy: Policy, tick: int, state: Bits, answers: Sequence[Bits]
) -> tuple[int, str]:
    """Return what a policy decides that is given these answers, whatever it asks."""
    return answered(policy.decide(tick, state), lambda _: list(answers))


def decided_by(
    graph: PocGraph, policy: Policy, tick: int, state: Bits
) -> tuple[int, str]:
    """Return what a policy decides whose questions a graph answers."""
    return answered(
        policy.decide(tick, state), lambda signals: [graph.up(one) for one in signals]
    )


def answered(
    deliberation: Deliberation, answer: Callable[[list[Signal]], list[Bits]]
) -> tuple[int, str]:
    """Return the action and the reason of a policy whose rounds are answered."""
    try:
        signals = next(deliberation)
        while True:
            signals = deliberation.send(answer(signals))
    except StopIteration as end:
        action, why = end.value
        return action, why
