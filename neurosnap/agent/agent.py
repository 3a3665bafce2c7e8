"""An agent in one process: observes, updates its state, decides, explains.

The same policies decide in a swarm, where waves answer what here the propagation over
the graph answers: with the same seed and observations the decisions are the same.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self, Unpack

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.environment import Continuing, Outing, describe
from neurosnap.agent.grower import ROOM
from neurosnap.agent.imagining_planner import STATES, ImaginingPlanner
from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.planner import target_literals
from neurosnap.agent.policy import TRIES, AgentKind, Aim, Policy, default_threshold
from neurosnap.agent.policy_kinds import Aims, new_policy
from neurosnap.agent.tick import Mind, Sensed, answered_at_once, tick
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium, as_known, complete
from neurosnap.wire import Decision


class Agent:
    """Learns from every observation and decides what to do next.

    Args:
        body: What is sensed and done. If it has room, sensors are grown from what
            surprises the agent.
        policy: Decides.
        snapshot: Learns, one sensor for each of the body's; if None, a new empirical
            one.
        memory: That of a policy that imagines; if None, a new one, for a policy that
            does not imagine.

    Raises:
        ShapeError: The snapshot has another number of sensors.
        InvalidValueError: The body has room for sensors to be grown, and its actions
            are not sensed in context.

    Examples:
        >>> body = Body.full(["warm", "better", "worse"], ["stay", "go"], [0, 1, 1])
        >>> agent = Agent(body, new_policy("excited", body, seed=1))
        >>> for _ in range(3):
        ...     print(agent.act([1, 0, 0]).why)
        guarantees better
        guarantees better
        at random: nothing guarantees better or worse*

        Sensors alike in all observations count as equivalent, so at first it expects
        too much. Once both actions have failed to make it better, it knows of none.
    """

    def __init__(
        self,
        body: Body,
        policy: Policy,
        snapshot: Snapshot | None = None,
        memory: AgentMemory | None = None,
    ) -> None:
        if snapshot is None:
            snapshot = EmpiricalSnapshot(Sensorium(body.sensors))
        if len(snapshot.sensorium) != len(body.sensors):
            rule = f"must have {len(body.sensors)} sensors, as the body"
            raise ShapeError("snapshot", rule, len(snapshot.sensorium))
        memory = AgentMemory(body) if memory is None else memory
        self._mind = Mind(snapshot, policy, memory)
        self._own = Sensorium(body.own)
        self._senses = Senses(body)
        self._seed, self._states = 0, STATES

    @classmethod
    def of(
        cls,
        env: gymnasium.Env[Any, Any],
        kind: AgentKind,
        *,
        seed: int = 0,
        snapshot: Snapshot | None = None,
        grow: bool | int = False,
        imagine: bool | int = False,
        **aims: Unpack[Aims],
    ) -> Self:
        """Return an agent for an environment, with every action in every context.

        Args:
            env: Its observations are ``MultiBinary``; see `BinarySensors` for others.
            kind: ``"walker"``, ``"excited"`` or ``"planner"``.
            seed: Draws whatever is random.
            snapshot: Learns; if None, a new empirical one, with the threshold that
                `default_threshold` says.
            grow: Whether it may grow sensors from what surprises it, or how many.
            imagine: Whether a planner looks ahead by imagined waves, or how many states
                it may imagine for a decision.
            aims: `target`, `explore` and `prefer`, see
                `neurosnap.agent.policy_kinds.Aims`.

        Raises:
            InvalidValueError: The environment is not fit for it, or what is to be
                grown cannot be.
        """
        said = describe(type(env.unwrapped).__name__, env)
        room = ROOM if grow is True else int(grow)
        body = Body.full(said.sensors, said.actions, said.orders, room)
        if snapshot is None:
            threshold = default_threshold(body, said.discrete)
            snapshot = EmpiricalSnapshot(Sensorium(body.sensors), threshold)
        memory = AgentMemory(body, imagines=bool(imagine or room))
        states = STATES if imagine is True else int(imagine)
        policy = new_policy(
            kind, body, seed, imagine=states, experience=memory.experience, **aims
        )
        agent = cls(body, policy, snapshot, memory)
        agent._seed, agent._states = seed, states or STATES
        return agent

    def run(
        self, env: gymnasium.Env[Any, Any], steps: int, *, seed: int | None = None
    ) -> Outing:
        """Act in an environment for so many steps, episode after episode.

        Args:
            env: The one it was made for, or one alike; it is reset, and not closed.
            steps: How many actions to take.
            seed: For the reset.

        Raises:
            InvalidValueError: The environment is not fit for it, or `steps` is
                negative.
        """
        return self._walk(env, steps, seed, [])

    def learn(
        self, env: gymnasium.Env[Any, Any], steps: int, *, seed: int | None = None
    ) -> Outing:
        """Explore an environment: go where the outcome of an action is unknown.

        Whatever its policy is, it is as before afterwards; what was learned stays.
        Arguments and errors are those of `run`.
        """
        return self._sent(env, (), steps, seed, explore=TRIES)

    def send(
        self,
        env: gymnasium.Env[Any, Any],
        target: Iterable[str | int],
        steps: int = 1000,
        *,
        seed: int | None = None,
    ) -> Outing:
        """Go to where all of a target is sensed, by what has been learned.

        Whatever its policy is, it is as before afterwards.

        Args:
            env: As in `run`.
            target: Sensations to achieve jointly, by name or number.
            steps: After how many actions to give up.
            seed: For the reset.

        Raises:
            InvalidValueError: The environment or the target is not fit for it.
        """
        return self._sent(env, tuple(target), steps, seed, explore=0.0)

    def aim(self, target: Aim, explore: float = 0.0) -> None:
        """Plan by imagined waves from now on, for another target or for none.

        Args:
            target: Sensations to achieve jointly, by name or number; none: to explore.
                Or, as a mapping, what each of some sensations is worth, to get most.
            explore: The share of random actions.

        Raises:
            InvalidValueError: It does not imagine, or the target is not fit for it.
        """
        experience = self._mind.memory.experience
        if experience is None:
            rule = "must be one that imagines or grows sensors"
            raise InvalidValueError("agent", rule, type(self._mind.policy).__name__)
        given = target, self._seed, explore, experience, self._states
        curious = not isinstance(target, Mapping)
        self._mind.policy = ImaginingPlanner(self.body, *given, curious=curious)

    def _sent(
        self,
        env: gymnasium.Env[Any, Any],
        target: Sequence[str | int],
        steps: int,
        seed: int | None,
        explore: float,
    ) -> Outing:
        """Go for a target, or explore, and be as before."""
        before = self._mind.policy
        self.aim(target, explore)
        wanted = list(target_literals(self.body, target)) if target else []
        try:
            return self._walk(env, steps, seed, wanted)
        finally:
            before.grow(self.body)
            self._mind.policy = before
            if self._mind.memory.experience is not None:
                self._mind.memory.experience.aim()  # what there was is not that policy's

    def _walk(
        self,
        env: gymnasium.Env[Any, Any],
        steps: int,
        seed: int | None,
        wanted: list[int],
    ) -> Outing:
        """Act until so many steps are done, or all that is wanted is sensed.

        The environment is reset first, and whenever an episode is over. What the last
        step led to is observed, too.
        """
        if steps < 0:
            raise InvalidValueError("steps", "must be 0 or more", steps)
        said = describe(type(env.unwrapped).__name__, env)
        going_on = env if isinstance(env, Continuing) else Continuing(env)
        bits, info = going_on.reset(seed=seed)
        self.set_down()
        taken, episodes, total = 0, 1, 0.0
        while True:
            decision = self.act(bits, info["begins"])
            sensed = complete(np.asarray(bits, np.bool_))
            told = np.concatenate((sensed, self.state[len(sensed) :]))
            reached = bool(wanted) and bool(told[wanted].all())
            if reached or taken == steps:
                self.take(-1, decision.why)  # it was decided, and is not done
                return Outing(taken, episodes, total, reached)
            bits, reward, _, _, info = going_on.step(said.step(decision.action))
            taken, total = taken + 1, total + float(reward)
            episodes += info["begins"]
            if info["cut"]:
                self.set_down()

    @property
    def snapshot(self) -> Snapshot:
        """The snapshot: what has been learned."""
        return self._mind.snapshot

    @property
    def body(self) -> Body:
        """The body: what is sensed and done, grown sensors included."""
        return self._mind.memory.body

    @property
    def decision(self) -> Decision:
        """The last decision; its tick is the snapshot's clock since the agent began."""
        return self._mind.decision

    @property
    def state(self) -> NDArray[np.bool_]:
        """``(2N,)``, coherent: its idea of the present."""
        return self.snapshot.state

    @property
    def chance(self) -> dict[str, dict[str, float]]:
        """What actions lead to unforeseen: by action, own sensations with a share.

        The share says how often one came without being guaranteed, of the last times it
        came after that action, four to sixteen. Results are listed that were unforeseen
        at least every other time, and those that no more sensors are grown for: the
        contexts that seemed to tell when they come have failed too often.
        """
        return self._mind.memory.chance

    def set_down(self) -> None:
        """Begin a new trajectory with the next observation: the agent was moved.

        To be told before an observation that begins a trajectory though the last one
        had not come to its end: after a limit on time, or a reset.
        """
        self.take(-1, "set down")

    def take(self, action: int, why: str = "") -> None:
        """Go on from another action than it decided on; -1: none was taken."""
        self._mind.memory.decision = Decision(self.decision.tick, action, why)

    def act(
        self,
        bits: ArrayLike,
        begins: bool = False,
        known: NDArray[np.bool_] | None = None,
    ) -> Decision:
        """Observe, learn, and decide.

        A sensor whose reading is unknown is neither on nor off: it is in the state as
        what the known ones imply of it, or not at all, and so are the contextual
        sensors of the next step that look at it. As a policy sees the state alone, a
        decision cannot depend on what such a sensor would have read.

        Args:
            bits: ``(n,)``, what the world's own sensors read after the last decision's
                action; what the unknown ones are means nothing.
            begins: It is the first observation of a trajectory, an episode's say, and
                follows no action. The very first one is, said or not.
            known: ``(n,)`` bool, which readings are known, one at least; if None, all.

        Returns:
            The decision: the action that is taken, and why. O(N²) time.

        Raises:
            ShapeError: Another number of bits, or of known ones.
            InvalidValueError: An entry is not 0 or 1, or no reading is known.
        """
        return self.follow(self.sense(bits, begins, known))

    def sense(
        self, bits: ArrayLike, begins: bool, known: NDArray[np.bool_] | None
    ) -> Sensed:
        """Return the whole observation, for `follow`; arguments are those of `act`."""
        own, sure = self._own.observation(bits), self._checked(known)
        step = self.decision.action, self.state, begins
        return Sensed(*self._senses.observe(own, sure, *step), begins)

    def follow(self, seen: Sensed) -> Decision:
        """Learn from what was sensed, and decide."""
        steps = tick(self._mind, seen)
        if answered(steps, lambda asked: answered_at_once(asked, self._mind, seen)):
            self._senses.fit(self.body)
        return self.decision

    def consequences(self, action: int | str) -> NDArray[np.bool_]:
        """Return ``(2N,)``: what an action, by name or number, guarantees here.

        Raises:
            InvalidValueError: There is no such action, or actions are not sensed.
        """
        names = self.body.actions
        if action not in (*names, *range(len(names))):
            rule = f"must be one of {', '.join(names)}"
            raise InvalidValueError("action", rule, action)
        number = names.index(action) if isinstance(action, str) else action
        signal = Actions(self.body).signals(self.state)[number]
        closure = self.snapshot.poc_graph().up(signal)
        bound: NDArray[np.bool_] = guaranteed([closure])[0]
        return bound

    def _checked(self, known: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
        """Return which own readings are known, as a source says it; None if all are."""
        if known is None:
            return None
        own = as_known(known, len(self.body.own))
        if not own.any():
            raise InvalidValueError("known", "must hold one at least", own.tolist())
        return own.copy()  # the next tick looks back at it
