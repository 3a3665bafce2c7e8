"""The steps of a tick, in their order, and what they leave behind."""

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.policies import new_policy
from neurosnap.agent.tick import Mind, Request, Sensed, Step, answered_at_once, tick
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.sensorium import Sensorium

BODY = Body.full(["warm", "better", "worse"], ["stay", "go"], [0, 1, 1])


def new_mind() -> Mind:
    snapshot = EmpiricalSnapshot(Sensorium(BODY.sensors))
    return Mind(snapshot, new_policy("excited", BODY, seed=1), AgentMemory(BODY))


def gone_through(mind: Mind, sensed: Sensed) -> list[Request]:
    """Go through a tick; return what it asked for."""
    asked: list[Request] = []
    steps, answer = tick(mind, sensed), None
    while True:
        try:
            asked.append(steps.send(answer))
        except StopIteration:
            return asked
        answer = answered_at_once(asked[-1], mind, sensed)


def test_it_learns_then_asks_for_the_state_and_then_for_consequences() -> None:
    mind = new_mind()
    sensed = Sensed(np.zeros(len(BODY.sensors), np.bool_))
    for number in (1, 2):
        *first, signals = gone_through(mind, sensed)
        assert first == [Step.LEARN, Step.STATE_WAVE]
        assert isinstance(signals, list)
        assert len(signals) == len(BODY.actions)
        assert mind.decision.tick == number
        assert mind.snapshot.clock == number


def test_the_decision_stays_until_the_tick_has_come_to_its_end() -> None:
    mind = new_mind()
    before = mind.decision
    steps = tick(mind, Sensed(np.zeros(len(BODY.sensors), np.bool_)))
    next(steps)
    assert (mind.decision, mind.snapshot.clock) == (before, 0)
