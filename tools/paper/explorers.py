"""Agents that explore a world, with or without growth, and then travel to targets."""

from collections.abc import Callable, Iterable
from copy import deepcopy
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner
from neurosnap.agent.policy import EXPLORE, Aim, Closures, Deliberation, Policy
from tools.paper.worlds_as_tables import Setting, Stage, StageEnv, stage_of

CHECKS = 40
"""How often a learner is held against the truth while it explores."""


class Explorer(Agent):
    """An agent whose planning waves are counted."""

    waves = 0
    """Asked for so far."""

    def aim(self, target: Aim, explore: float = 0.0) -> None:
        """Plan by imagined waves from now on; see `Agent.aim`."""
        super().aim(target, explore)
        self._mind.policy = _Counted(self._mind.policy, self)

    def aim_greedily(self, target: Iterable[str | int]) -> None:
        """Plan one step ahead from now on."""
        planner = Planner(self.body, target, self._seed, explore=0.0)
        self._mind.policy = _Counted(planner, self)

    def whole(self, stage: Stage) -> tuple[int, int, int]:
        """Hold what actions guarantee against a stage.

        A coin may lie either way and is not held against anybody.

        Returns:
            Of how many moves all is guaranteed that is sure to come, of how many
            something that may not, and how many there are.
        """
        graph, actions = self.snapshot.poc_graph(), Actions(self.body)
        own = 2 * len(stage.sensors)
        whole = false = count = 0
        state = np.zeros(2 * len(self.body.sensors), np.bool_)
        for place in np.flatnonzero(~stage.over).tolist():
            state[:] = False
            state[stage.literals(place)] = True
            state[own + 1 : 2 * len(self.body.own) : 2] = True  # coins that are off
            for action, signal in enumerate(actions.signals(state)):
                said = guaranteed([graph.up(signal)])[0][:own]
                ways = [after for _, after in stage.outcomes[place][action]]
                sure = np.zeros(own, np.bool_)
                always = stage.fields[:, ways]
                sure[::2], sure[1::2] = always.all(axis=1), (~always).all(axis=1)
                whole += bool((said >= sure).all())
                false += bool((said & ~sure).any())
                count += 1
        return whole, false, count


class _Counted:
    """A policy whose waves are counted."""

    def __init__(self, policy: Policy, who: Explorer) -> None:
        self._policy, self._who = policy, who

    def grow(self, body: Body) -> None:
        self._policy.grow(body)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        inner = self._policy.decide(tick, state)
        answers: Closures | None = None
        while True:
            try:
                asked = next(inner) if answers is None else inner.send(answers)
            except StopIteration as end:
                action, why = end.value
                return action, why
            if isinstance(asked, list):
                self._who.waves += len(asked)
            answers = yield asked


class _Watched(StageEnv):
    """A stage that calls somebody after every so many steps."""

    def __init__(self, stage: Stage, every: int, then: Callable[[], None]) -> None:
        super().__init__(stage)
        self._every, self._then, self._steps = every, then, 0

    def step(self, action: Any) -> Any:  # noqa: ANN401 - as a stage's
        result = super().step(action)
        self._steps += 1
        if self._steps % self._every == 0:
            self._then()
        return result


def explored(
    setting: Setting, seed: int, *, grows: bool
) -> tuple[Explorer, NDArray[np.int32]]:
    """Return an agent that has explored a world, and its learning curve.

    Args:
        setting: The world.
        seed: Draws all there is to draw.
        grows: Whether the agent grows sensors.

    Returns:
        An agent of one's own; ``(CHECKS, 4)``: moves of which all is guaranteed, of
        which something false is, sensors ever grown, sensors in use.
    """
    agent, curve = _explored(setting, seed, grows=grows)
    return deepcopy(agent), curve


@lru_cache(maxsize=2)
def _explored(
    setting: Setting, seed: int, *, grows: bool
) -> tuple[Explorer, NDArray[np.int32]]:
    stage = stage_of(setting)
    curve: list[tuple[int, int, int, int]] = []

    def check() -> None:
        whole, false, _ = agent.whole(stage)
        grown, used = len(agent.body.grown), len(agent.body.in_use)
        curve.append((whole, false, grown, used))

    env = _Watched(stage, max(1, setting.steps // CHECKS), check)
    # What neither grows nor imagines could not be sent anywhere by imagined waves.
    walker = setting.walk and grows
    agent = Explorer.of(
        env,
        "walker" if walker else "planner",
        seed=seed,
        explore=1.0 if setting.walk else EXPLORE,
        grow=setting.room if grows else 0,
        imagine=not walker,
    )
    explore = agent.run if setting.walk else agent.learn
    explore(env, setting.steps, seed=seed)
    while len(curve) < CHECKS:  # a reset takes a step, too
        check()
    return agent, np.array(curve[:CHECKS], np.int32)


class Journey(NamedTuple):
    """The result of an agent's way to a target: its steps, waves and falls."""

    steps: int
    """Taken; -1 if it did not arrive."""
    waves: int
    """Planning waves."""
    falls: int
    """Steps into a hole or over the cliff."""
    unforeseen: int
    """Those of which the agent did not know before that they were one: the action
    guaranteed something less than the place where it ended."""


def journey(
    agent: Explorer,
    stage: Stage,
    start: int,
    goal: NDArray[np.bool_],
    limit: int,
    *,
    imagine: bool = True,
    seed: int = 0,
) -> Journey:
    """Send an agent from a place to where all sensations of a goal hold.

    Args:
        agent: Goes on learning.
        stage: Its world.
        start: The place.
        goal: ``(2 sensors,)``, literals.
        limit: Steps after which it is given up.
        imagine: Whether it plans by imagined waves.
        seed: Draws outcomes.
    """
    env = StageEnv(stage)
    env.reset(seed=seed)
    env.put(start)
    wanted = goal.nonzero()[0].tolist()
    if imagine:
        agent.aim(wanted)
    else:
        agent.aim_greedily(wanted)
    agent.set_down()
    before, falls, unforeseen = agent.waves, 0, 0
    for steps in range(limit + 1):
        if stage.fields[goal[::2], env.place].all() and not (
            stage.fields[goal[1::2], env.place].any()
        ):
            return Journey(steps, agent.waves - before, falls, unforeseen)
        if stage.over[env.place]:
            break
        action = agent.act(env.reading(), begins=steps == 0).action
        here = env.place
        env.step(action)
        if (here, action, env.place) in stage.falls:
            falls += 1
            unforeseen += not agent.consequences(action)[
                stage.literals(env.place)
            ].all()
    return Journey(-1, agent.waves - before, falls, unforeseen)
