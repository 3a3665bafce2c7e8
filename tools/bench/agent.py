"""The row on acting: a whole cycle of an agent.

The plain agent is the same agent with the memory in plain numpy: dense weights, edges
as a matrix, closures by a breadth-first walk. It has to decide the same.
"""

import time

import gymnasium
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.excited import Excited
from neurosnap.agent.policy import Signal, decided
from neurosnap.agent.senses import Senses
from neurosnap.poc.learning.kinds import EmpiricalSnapshot, Snapshot
from neurosnap.sources.gymnasium_source import import_worlds
from tools.bench.observe import Plain
from tools.bench.report import Line, Sizes

_PLACES = 21  # 145 sensors in all
_LEARNED = 2000  # steps before the clock starts
_FEW = 5
_THRESHOLD = 1 / 8000
_REACH = 300e-6

Bits = NDArray[np.bool_]


def cycle(sizes: Sizes) -> list[Line]:
    """Time observing, the state, every action's consequences, and the decision."""
    world = _World()
    agent, bits = world.learned()
    body = agent.body
    plain = _PlainAgent(body, agent.snapshot, agent.decision.action)
    expected, theirs = [], []
    seen = [bits]
    began = time.perf_counter()
    for _ in range(_FEW):
        expected.append(plain.act(seen[-1]))
        seen.append(world.step(expected[-1]))
    theirs.append((time.perf_counter() - began) / _FEW)
    ours = []
    found = [agent.act(one).action for one in seen[:-1]]
    if found != expected:
        raise RuntimeError("cycle: must decide what the plain agent decides")
    now = seen[-1]
    for _ in range(sizes.batches):
        began = time.perf_counter()
        for _ in range(_LEARNED // 10):
            now = world.step(agent.act(now).action)
        ours.append((time.perf_counter() - began) / (_LEARNED // 10))
    best, bare = min(ours), min(theirs)
    return [
        Line(
            f"a whole cycle of an excited agent, {len(body.sensors)} sensors",
            f"{best * 1e6:.0f} µs (1/{bare / best:.0f} of numpy)",
            f"plain numpy {bare * 1e6:.0f} µs",
            "≤ 300 µs",
            best <= _REACH,
            {"seconds": best, "numpy_seconds": bare, "times_numpy": bare / best},
        ),
    ]


class _World:
    """A path with a target, stepped without Gymnasium's check of what comes back."""

    def __init__(self) -> None:
        import_worlds()
        self._env = gymnasium.make(
            "neurosnap/Path-v0", places=_PLACES, target=5, disable_env_checker=True
        )
        get = self._env.get_wrapper_attr
        self.moves, self.fields = get("moves"), get("fields")
        self.distances = get("distances")

    def learned(self) -> tuple[Agent, Bits]:
        """Return an agent that has been here for a while, and what it sees next."""
        agent = Agent.of(
            self._env,
            "excited",
            seed=1,
            snapshot=EmpiricalSnapshot(145, _THRESHOLD),
        )
        bits, _ = self._env.reset(seed=1)
        now = bits.astype(np.bool_)
        for _ in range(_LEARNED):
            now = self.step(agent.act(now).action)
        return agent, now

    def step(self, action: int) -> Bits:
        """Return what is seen after an action."""
        bits, *_ = self._env.step(action)
        return np.asarray(bits, np.bool_)


class _PlainAgent:
    """The agent with its memory in plain numpy, from where another one is."""

    def __init__(self, body: Body, snapshot: Snapshot, action: int) -> None:
        self._plain = Plain(snapshot)
        self._policy = Excited(body, seed=1)
        self._senses = Senses(body)
        self._state = snapshot.state
        self._tick, self._action = snapshot.clock, action

    def act(self, bits: Bits) -> int:
        """Return the action after one more observation."""
        observation = self._senses.observe(bits, self._action, self._state)
        self._state = self._plain.observe(observation)
        self._tick += 1
        deliberation = self._policy.decide(self._tick, self._state)
        self._action, _ = decided(deliberation, self._above)
        return self._action

    def _above(self, signal: Signal) -> Bits:
        literals = np.zeros(self._state.size, np.bool_)
        literals[list(signal)] = True
        return self._plain.above(literals)
