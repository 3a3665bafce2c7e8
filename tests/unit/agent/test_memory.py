"""What an agent knows besides its snapshot, saved and taken up again."""

import numpy as np
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.memory import AgentMemory, body_in
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sources.open import open_source
from tests.support.run_options import options_for
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


def test_whatever_is_missing_or_wrong_is_an_error(explorer: Agent) -> None:
    arrays = unpack_arrays(explorer._mind.memory.to_bytes())
    for name in arrays:
        less = {key: array for key, array in arrays.items() if key != name}
        with pytest.raises(ValueError, match=r"."):
            blank(explorer).restore(pack_arrays(less))
        for wrong in (np.array(-1), np.array(["x"]), np.full((2, 3, 4), -7)):
            with pytest.raises(ValueError, match=r"."):
                blank(explorer).restore(pack_arrays({**arrays, name: wrong}))
    for data in (b"", b"no archive"):
        with pytest.raises(ValueError, match=r"."):
            blank(explorer).restore(data)


@pytest.mark.parametrize(("name", "value"), [("trials", 99), ("ready", 99)])
def test_numbers_of_another_body_are_an_error(
    explorer: Agent, name: str, value: int
) -> None:
    arrays = unpack_arrays(explorer._mind.memory.to_bytes())
    wrong = np.full_like(arrays[name], value)
    assert wrong.size
    with pytest.raises(ValueError, match=f"{name}: must be"):
        blank(explorer).restore(pack_arrays({**arrays, name: wrong}))


def test_what_was_taken_up_again_goes_on_to_the_same_bytes() -> None:
    options = options_for(
        "neurosnap/FrozenLake-v0", 2, agent="planner", grow=20, imagine=50, target=()
    )
    source = open_source(options.source, options.seed)
    agent, seen = agent_of(options, options.new_memory()), source.first()
    twin, taken_up = agent, 0
    for tick in range(1, 241):
        assert seen is not None
        if tick % 60 == 0:
            memory = options.new_memory()
            memory.restore(agent._mind.memory.to_bytes())
            twin = agent_of(options, memory, agent.snapshot.to_bytes())
            assert twin.decision == agent.decision
            taken_up += 1
        decision = agent.act(seen.bits, seen.begins)
        if taken_up:
            assert twin.act(seen.bits, seen.begins) == decision
            assert twin._mind.memory.to_bytes() == agent._mind.memory.to_bytes()
            assert twin.snapshot.to_bytes() == agent.snapshot.to_bytes()
        seen = source.step(decision.action)
    source.close()
    assert taken_up == 4
    assert len(agent.body.grown) > 5


def agent_of(options: RunOptions, memory: AgentMemory, learned: bytes = b"") -> Agent:
    """Return an agent that goes on from what was saved."""
    policy = options.policy_with(memory)
    policy.grow(memory.body)
    snapshot = Snapshot.from_bytes(learned) if learned else options.new_snapshot()
    return Agent(memory.body, policy, snapshot, memory)
