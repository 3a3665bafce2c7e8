"""An agent in one process: observes, updates its state, decides, explains.

The same policies decide in a swarm, where waves answer what here the propagation over
the graph answers: with the same seed and observations the decisions are the same.
"""

from collections.abc import Iterable
from typing import Any, Self

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body, Senses
from neurosnap.agent.environment import describe
from neurosnap.agent.policies import new_policy
from neurosnap.agent.policy import EXPLORE, AgentKind, Policy
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.kinds import EmpiricalSnapshot, Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium, as_known
from neurosnap.wire import Decision


class Agent:
    """Learns from every observation and decides what to do next.

    Args:
        body: What is sensed and done.
        policy: Decides.
        snapshot: Learns, one sensor for each of the body's; None: a new empirical one.

    Raises:
        ShapeError: The snapshot has another number of sensors.

    Example:
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
        self, body: Body, policy: Policy, snapshot: Snapshot | None = None
    ) -> None:
        self.body = body
        self.snapshot = (
            EmpiricalSnapshot(Sensorium(body.sensors)) if snapshot is None else snapshot
        )
        if len(self.snapshot.sensorium) != len(body.sensors):
            rule = f"must have {len(body.sensors)} sensors, as the body"
            raise ShapeError("snapshot", rule, len(self.snapshot.sensorium))
        self._policy = policy
        self._own = Sensorium(body.own)
        self._senses = Senses(body)
        self._known: NDArray[np.bool_] | None = None  # of the last own readings
        self._decision = Decision(0, -1, "the run begins")

    @classmethod
    def of(
        cls,
        env: gymnasium.Env[Any, Any],
        kind: AgentKind,
        *,
        target: Iterable[str | int] = (),
        seed: int = 0,
        explore: float = EXPLORE,
        snapshot: Snapshot | None = None,
    ) -> Self:
        """Return an agent for an environment, with every action in every context.

        Args:
            env: Its observations are ``MultiBinary``; see `BinarySensors` for others.
            kind: ``"walker"``, ``"excited"`` or ``"planner"``.
            target: For a planner: sensations to achieve jointly, by name.
            seed: Draws whatever is random.
            explore: The share of random actions.
            snapshot: Learns; None: a new empirical one.

        Raises:
            InvalidValueError: The environment is not fit for it.
        """
        said = describe(type(env.unwrapped).__name__, env)
        body = Body.full(
            said.sensors, said.actions, said.orders, exclusive=said.exclusive
        )
        policy = new_policy(kind, body, seed, target=target, explore=explore)
        return cls(body, policy, snapshot)

    @property
    def decision(self) -> Decision:
        """The last decision; its tick is the snapshot's clock since the agent began."""
        return self._decision

    @property
    def state(self) -> NDArray[np.bool_]:
        """``(2N,)``, coherent: its idea of the present."""
        return self.snapshot.state

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
            known: ``(n,)`` bool, which readings are known, one at least; None: all.

        Returns:
            The decision: the choice of the body's that is made, and why. O(N²) time.

        Raises:
            ShapeError: Another number of bits, or of known ones.
            InvalidValueError: An entry is not 0 or 1, or no reading is known.
        """
        own, sure = self._own.observation(bits), self._checked(known)
        last, tick = self._decision, self._decision.tick + 1
        step = (-1 if begins else last.action, self.state)
        state = self.snapshot.observe(
            self._senses.observe(own, *step),
            self._senses.known(sure, *step, self._known),
        )
        self._known = sure
        graph = self._graph()
        answers = [graph.up(signal) for signal in self._policy.ask(tick, state)]
        action, why = self._policy.decide(tick, state, answers)
        self._decision = Decision(tick, action, why)
        return self._decision

    def consequences(self, action: int | str) -> NDArray[np.bool_]:
        """Return what an action taken here guarantees: ``(2N,)``.

        Args:
            action: Its name, or the number of a choice.

        Raises:
            InvalidValueError: There is no such action, or actions are not sensed.
        """
        signals = Actions(self.body).signals(self.state)
        number = _choice(self.body, action) if isinstance(action, str) else action
        if not 0 <= number < len(signals):
            rule = f"must be one of {', '.join(self.body.actions)}"
            raise InvalidValueError("action", rule, action)
        closure: NDArray[np.bool_] = self._graph().up(signals[number])
        bound: NDArray[np.bool_] = guaranteed([closure])[0]
        return bound

    def _checked(self, known: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
        """Return which own readings are known, as a source says it; None: all are."""
        if known is None:
            return None
        own = as_known(known, len(self.body.own))
        if not own.any():
            raise InvalidValueError("known", "must hold one at least", own.tolist())
        return own.copy()  # the next tick looks back at it

    def _graph(self) -> PocGraph:
        return self.snapshot.poc_graph()


def _choice(body: Body, action: str) -> int:
    """Return the choice that takes one action and no other; -1: there is none."""
    if action not in body.actions:
        return -1
    number = body.actions.index(action)
    return number if body.exclusive else 1 << number
