"""Policies that are answered by hand, or by a graph."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent import policy as policies
from neurosnap.agent.policy import Policy, Signal
from neurosnap.poc.order.graph import PocGraph

Bits = NDArray[np.bool_]


def asked(policy: Policy, tick: int, state: Bits) -> list[Signal]:
    """Return what a policy asks first; nothing if it decides at once."""
    return next(policy.decide(tick, state), [])


def decided(
    policy: Policy, tick: int, state: Bits, answers: Sequence[Bits]
) -> tuple[int, str]:
    """Return what a policy decides that is given these answers, whatever it asks."""
    deliberation = policy.decide(tick, state)
    try:
        next(deliberation)
        while True:
            deliberation.send(answers)
    except StopIteration as end:
        action, why = end.value
        return action, why


def decided_by(
    graph: PocGraph, policy: Policy, tick: int, state: Bits
) -> tuple[int, str]:
    """Return what a policy decides whose questions a graph answers."""
    return policies.decided(policy.decide(tick, state), graph.up)
