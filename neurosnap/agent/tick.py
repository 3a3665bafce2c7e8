"""One tick of an agent, as a generator that yields requests to its caller.

`tick` is a generator. It yields what it needs done, and is sent the answer: in a swarm
the coordinator does that by messages, in one process the agent does it at once, and a
replay gives the coordinator what was recorded. So all three go through the same steps,
and the same observations lead to the same decisions.
"""

import enum
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.policy import Policy, Signal
from neurosnap.poc.learning.history_questions import Question
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.wire import Decision


@dataclass(slots=True)
class Mind:
    """The lasting parts of an agent: what it has learned, its policy, its memory."""

    snapshot: Snapshot
    policy: Policy
    memory: AgentMemory

    @property
    def decision(self) -> Decision:
        """The last decision; its tick is the last whole one."""
        return self.memory.decision


class Sensed(NamedTuple):
    """An observation of all sensors."""

    bits: NDArray[np.bool_]
    """``(N,)``: the readings."""
    known: NDArray[np.bool_] | None = None
    """``(N,)``, which of them are known; None if all are."""
    begins: bool = False
    """It begins a trajectory: the last action did not lead to it."""
    cut: bool = False
    """It begins one, and no one saw what the last action would have led to."""


class Step(enum.Enum):
    """A request of a tick that its caller must carry out."""

    LEARN = enum.auto()
    """The snapshot learns it; the answer is nothing."""
    STATE_WAVE = enum.auto()
    """What is observed spreads. The answer is the state, ``(2N,)``: all that was
    reached, without its contradictions. The snapshot has adopted it by then."""


Request: TypeAlias = Step | Question | list[Signal]
"""What a tick needs done. A `Question` goes to the histories of the sensors, and is
answered by an `Answer`; signals are answered by their `Closures`, as planning waves."""
Steps: TypeAlias = Generator[Request, Any, bool]
"""A tick under way; returns whether any sensor came or went with its decision."""


def tick(mind: Mind, sensed: Sensed) -> Steps:
    """Go through one tick, from an observation to the decision on it.

    The mind is as it was after the tick before. The steps are those of docs/design.md,
    "A tick"; the decision is `mind.decision` at the end.
    """
    snapshot, memory, last = mind.snapshot, mind.memory, mind.decision
    # 1. What came is held against what the last action guaranteed, by what was
    #    believed before this observation.
    surprise = memory.observe(
        -1 if sensed.cut else last.action,
        sensed.begins,
        sensed.bits,
        sensed.known,
        snapshot,
    )
    # 2. Weights, order and wiring follow the observation.
    yield Step.LEARN
    # 3. to 5. What was read spreads, and what has been reached gives the state.
    state = yield Step.STATE_WAVE
    # 6. If the action did not guarantee what came, the histories are searched.
    yield from surprise
    memory.settle(state, snapshot)
    # 7. The policy asks for consequences, round after round.
    number = last.tick + 1
    action, why = yield from mind.policy.decide(number, state)
    # 8. The decision also says which sensor is grown, or read no more, from the next
    #    observation on. (9. The world acts.)
    decision = Decision(number, action, why, **memory.changes)
    changed = memory.follow(decision, snapshot)
    if changed:
        mind.policy.grow(memory.body)
    return changed


def answered_at_once(request: Request, mind: Mind, sensed: Sensed) -> object:
    """Do in this process what a tick has yielded; return the answer."""
    if request is Step.LEARN:
        return mind.snapshot.learn(sensed.bits, sensed.known)
    if request is Step.STATE_WAVE:
        return mind.snapshot.project(sensed.known)
    if isinstance(request, Question):
        return mind.memory.history.answer(request)
    up = mind.snapshot.poc_graph().up
    return [up(signal) for signal in request]
