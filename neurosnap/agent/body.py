"""Bodies: the sensors and actions of an agent, contextual sensors included.

``α∧a`` is on iff action ``α`` was taken in the step that has just ended and literal
``a`` was in the state recorded before it. With it, what an action leads to where
becomes an implication like any other, ``α∧a → b``, which a snapshot can learn.

References:
    [GK] "Algorithm: Computing the consequences of an action", eqn:context.
"""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import Sensorium

_MOST_FREE = 10  # 2^10 generalised actions


class Body(msgspec.Struct, frozen=True, kw_only=True):
    """What an agent senses: its world's sensors, its actions, its actions in context.

    The sensors stand in this order. A contextual sensor is called ``action&sensor``,
    or ``action&~sensor`` where its literal is a complement.

    Raises:
        InvalidValueError: Two sensors have the same name, or a context names an action
            or a literal that does not exist.
    """

    own: tuple[str, ...]
    """The names of the world's own sensors."""
    orders: tuple[int, ...] = ()
    """For each, how many steps it looks back: 0 for a state sensor, 1 for a transition
    sensor; none at all if all are state sensors."""
    actions: tuple[str, ...] = ()
    """The names of the world's atomic actions."""
    exclusive: bool = True
    """Whether exactly one of them is taken at each step, or any choice of them."""
    senses_actions: bool = False
    """Whether each action is a sensor, on after the step it was taken in."""
    context: tuple[tuple[int, int], ...] = ()
    """The contextual sensors: each an action, and a literal of the world's own."""

    def __post_init__(self) -> None:
        if self.orders and len(self.orders) != len(self.own):
            rule = f"must be one for each of {len(self.own)} sensors"
            raise InvalidValueError("orders", rule, self.orders)
        if any(order < 0 for order in self.orders):
            raise InvalidValueError("orders", "must be 0 or more", self.orders)
        for action, literal in self.context:
            if not 0 <= action < len(self.actions):
                rule = f"must be of one of {len(self.actions)} actions"
                raise InvalidValueError("context", rule, (action, literal))
            if not 0 <= literal < 2 * len(self.own):
                rule = f"must be of a literal of {len(self.own)} sensors"
                raise InvalidValueError("context", rule, (action, literal))
        if len(set(self.actions)) < len(self.actions):
            raise InvalidValueError(
                "actions", "must have different names", self.actions
            )
        if not self.exclusive and len(self.actions) > _MOST_FREE:
            rule = f"must be at most {_MOST_FREE} where they do not exclude each other"
            raise InvalidValueError("actions", rule, len(self.actions))
        Sensorium(self.sensors)

    @classmethod
    def full(
        cls,
        own: Sequence[str],
        actions: Sequence[str],
        orders: Sequence[int] = (),
        *,
        exclusive: bool = True,
    ) -> "Body":
        """Return the body with every action in the context of every position literal.

        Position literals are those of state sensors. Where there are no actions, there
        is nothing to add.

        Example:
            >>> Body.full(["door"], ["push"]).sensors
            ('door', 'push', 'push&door', 'push&~door')
        """
        orders = tuple(orders) or (0,) * len(own)
        position = [
            literal
            for sensor, order in enumerate(orders)
            if order == 0
            for literal in (2 * sensor, 2 * sensor + 1)
        ]
        return cls(
            own=tuple(own),
            orders=orders,
            actions=tuple(actions),
            exclusive=exclusive,
            senses_actions=bool(actions),
            context=tuple(
                (action, literal)
                for action in range(len(actions))
                for literal in position
            ),
        )

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of all sensors, in order."""
        felt = self.actions if self.senses_actions else ()
        contextual = (
            f"{self.actions[action]}&{'~' * (literal & 1)}{self.own[literal >> 1]}"
            for action, literal in self.context
        )
        return (*self.own, *felt, *contextual)

    @property
    def choices(self) -> NDArray[np.bool_]:
        """``(choices, actions)``: what can be done, as which atomic actions are on.

        The pure actions where they exclude each other, in order; all ``2^actions``
        choices otherwise, the atomic actions of choice ``k`` being the bits of ``k``
        ([GK] synchronous actions).
        """
        count = len(self.actions)
        if self.exclusive:
            return np.eye(count, dtype=np.bool_)
        return (np.arange(2**count)[:, np.newaxis] >> np.arange(count) & 1).astype(
            np.bool_
        )

    @property
    def position(self) -> NDArray[np.bool_]:
        """``(2N,)``: the literals of the world's state sensors."""
        orders = self.orders or (0,) * len(self.own)
        rest = len(self.sensors) - len(self.own)
        flat = np.array([order == 0 for order in orders] + [False] * rest, np.bool_)
        return np.repeat(flat, 2)


class Senses:
    """Turns what the world shows into what the agent observes.

    Args:
        body: Which sensors there are.
    """

    def __init__(self, body: Body) -> None:
        own, felt = len(body.own), len(body.actions) * body.senses_actions
        self._own = slice(0, own)
        self._felt = slice(own, own + felt)
        self._contextual = slice(own + felt, own + felt + len(body.context))
        pairs = np.array(body.context, np.intp).reshape(-1, 2)
        self._action, self._literal = pairs.T
        self._choices = body.choices
        self._count = self._contextual.stop
        self.looks_back = bool(felt or body.context)
        """Whether an observation depends on the step before it."""

    def observe(
        self,
        bits: NDArray[np.bool_],
        action: int = -1,
        state: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:
        """Return the whole observation: ``(N,)``.

        Args:
            bits: What the world's own sensors read.
            action: The choice made in the step that has just ended; -1 at the
                beginning, when none was and no action or contextual sensor is on.
            state: ``(2N,)``, recorded before that step; None at the beginning.
        """
        observation = np.zeros(self._count, np.bool_)
        observation[self._own] = bits
        if action >= 0 and state is not None:
            taken = self._choices[action]
            if self._felt.start < self._felt.stop:
                observation[self._felt] = taken
            np.logical_and(
                taken[self._action],
                state[self._literal],
                out=observation[self._contextual],
            )
        return observation

    def known(
        self,
        own: NDArray[np.bool_] | None,
        action: int = -1,
        state: NDArray[np.bool_] | None = None,
        before: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_] | None:
        """Return which readings of the observation are known: ``(N,)``; None: all.

        Actions always are. ``α∧a`` is known where ``α`` was not taken, for then it is
        off; where a literal of the sensor was in the state before, even if only because
        something implied it; and where the sensor's reading was known then. (If that
        was contradicted, neither literal was in the state, and ``α∧a`` is off.)

        Args:
            own: ``(n,)``, which readings of the world's own sensors are known; None:
                all.
            action: As in `observe`.
            state: As in `observe`.
            before: As `own`, when `state` was recorded.
        """
        known = np.ones(self._count, np.bool_)
        if own is not None:
            known[self._own] = own
        if action >= 0 and state is not None and before is not None:
            literal = self._literal
            told = before[literal >> 1] | state[literal] | state[literal ^ 1]
            known[self._contextual] = told | ~self._choices[action][self._action]
        return None if known.all() else known
