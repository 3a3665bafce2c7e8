"""Saves and loads what an agent knows besides its snapshot."""

import numpy as np
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.memory import AgentMemory, body_in
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.sensorium import Sensorium
from world.toy_text import frozen_lake


@pytest.fixture(scope="module")
def explorer() -> Agent:
    agent = Agent.of(frozen_lake(), "planner", grow=20, imagine=True, seed=1)
    agent.learn(frozen_lake(), 250, seed=1)
    assert agent.body.grown
    return agent


def blank(explorer: Agent) -> AgentMemory:
    env = frozen_lake()
    body = Agent.of(env, "planner", grow=20, imagine=True).body
    assert len(body.sensors) == len(explorer.body.sensors)
    return AgentMemory(body, imagines=True)


def test_what_is_taken_up_again_is_all_there_was(explorer: Agent) -> None:
    data, again = explorer._mind.memory.to_bytes(), blank(explorer)
    again.restore(data)
    assert again.body == explorer.body == body_in(blank(explorer).body, data)
    assert again.to_bytes() == data


def test_where_there_is_nothing_to_know_nothing_is_said() -> None:
    memory = AgentMemory(Agent.of(frozen_lake(), "walker").body)
    assert memory.is_empty
    assert memory.to_bytes() == b""
    memory.restore(b"")


def refused(explorer: Agent, data: bytes, says: str = ".") -> None:
    with pytest.raises(ValueError, match=says):
        blank(explorer).restore(data)


def test_what_is_missing_or_wrong_or_of_another_body_is_an_error(
    explorer: Agent,
) -> None:
    arrays = unpack_arrays(explorer._mind.memory.to_bytes())
    for name in arrays:
        less = {key: array for key, array in arrays.items() if key != name}
        refused(explorer, pack_arrays(less))
        for wrong in (np.array(-1), np.array(["x"]), np.full((2, 3, 4), -7)):
            refused(explorer, pack_arrays({**arrays, name: wrong}))
    for text in (b"", b"[]", b'[[], [{"action": 99, "literals": [], "result": 0}]]'):
        more = {**arrays, "trials": np.frombuffer(text, np.uint8)}
        refused(explorer, pack_arrays(more), "^trials: ")
    for data in (b"", b"no archive"):
        refused(explorer, data)


def test_an_action_that_is_sensed_in_no_context_is_tried_all_the_same() -> None:
    body = Body(own=("moved",), orders=(1,), actions=("go",), senses_actions=True)
    memory = AgentMemory(body, imagines=True)
    snapshot = EmpiricalSnapshot(Sensorium(body.sensors))
    for both in (False, True):
        snapshot.observe(np.array([both, both]))
    memory.observe(0, False, np.array([False, True]), None, snapshot)
    assert memory.experience is not None
    # What it was to lead to did not come.
    assert memory.experience.surprises[0].tolist() == [1, 1]
