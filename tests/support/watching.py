"""A mind that is shown readings, and may grow windows of them."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.policy_kinds import Walker
from neurosnap.agent.tick import Mind, Sensed, answered_at_once, tick
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import answered
from neurosnap.sensorium import Sensorium

if TYPE_CHECKING:
    from neurosnap.wire import Decision


class Watching:
    """A mind that is shown rows of readings, and acts on nothing."""

    def __init__(
        self, sensors: int, room: int, threshold: float | str = "auto"
    ) -> None:
        self.own = tuple(f"s{k}" for k in range(sensors))
        body = Body(own=self.own, room=room)
        snapshot = EmpiricalSnapshot(Sensorium(body.sensors), threshold)
        self.mind = Mind(snapshot, Walker(0, 0), AgentMemory(body))
        self.senses = Senses(body)
        self.decisions: list[Decision] = []

    def show(self, rows: NDArray[np.bool_]) -> None:
        for row in rows:
            sensed = Sensed(*self.senses.observe(row))
            steps = tick(self.mind, sensed)
            answer = partial(answered_at_once, mind=self.mind, sensed=sensed)
            if answered(steps, answer):
                self.senses.fit(self.mind.memory.body)
            self.decisions.append(self.mind.decision)

    @property
    def grown(self) -> list[str]:
        body = self.mind.memory.body
        return list(body.sensors[body.first_grown : body.size])

    @property
    def retired(self) -> list[str]:
        body = self.mind.memory.body
        return [body.sensors[body.first_grown + place] for place in body.retired]
