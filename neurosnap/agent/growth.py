"""The history an agent grows sensors from, and who looks for covers in it."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body, Context
from neurosnap.agent.grower import Grower
from neurosnap.poc.learning.history import LENGTH, History
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph


class Growth:
    """Notices what an action did not guarantee, and has a sensor ready for it.

    Args:
        body: What is sensed and done, with room for what is grown.
        length: Ticks of the history.

    Raises:
        InvalidValueError: As for `Grower`.
    """

    def __init__(self, body: Body, length: int = LENGTH) -> None:
        self._grower = Grower(body)
        self._history = History(len(body.sensors), length)
        self._own = len(body.own)
        self._fit(body)

    def _fit(self, body: Body) -> None:
        self._body, self._actions = body, Actions(body)

    @property
    def hopeless(self) -> NDArray[np.bool_]:
        """``(actions, 2n)``: which results seem to be left to chance."""
        return self._grower.hopeless

    def notice(
        self,
        action: int,
        state: NDArray[np.bool_],
        graph: PocGraph,
        observation: NDArray[np.bool_],
        known: NDArray[np.bool_] | None,
    ) -> Context | None:
        """Take in an observation before it is learned; return what to grow for it.

        Args:
            action: That of the step that has ended; -1: none was.
            state: ``(2N,)``, recorded before it.
            graph: What is believed.
            observation: ``(N,)``.
            known: ``(N,)``, which of it is known; None: all.
        """
        self._history.enter(observation, known)
        if action < 0:
            return None
        closure = graph.up(self._actions.signals(state)[action])
        own = None if known is None else known[: self._own]
        bits = observation[: self._own]
        return self._grower.notice(action, state, closure, bits, own, self._history)

    def grow(self, body: Body, snapshot: Snapshot) -> None:
        """Give a snapshot the newest sensor of a body.

        Args:
            body: With the sensor, of the context that was asked for.
            snapshot: Without it.
        """
        sensor = body.first_grown + len(body.grown) - 1
        members = self._members(body.grown[-1])
        snapshot.grow(sensor, body.sensors[sensor], members, self._history)
        self._fit(body)

    def needless(self, tick: int, graph: PocGraph) -> int | None:
        """Return a grown sensor whose part of its context guarantees as much, if any.

        One sensor is looked at in a tick, the next in the next: ``O(N²/64)`` time.

        Args:
            tick: The tick.
            graph: What is believed.

        Returns:
            Its place in `Body.grown`.
        """
        body = self._body
        if not body.grown:
            return None
        place = tick % len(body.grown)
        if place in body.retired:
            return None
        action, literals = body.grown[place]
        first = 2 * body.first_grown
        part = [2 * (self._own + action), *self._members(body.grown[place])]
        for other, (which, fewer) in enumerate(body.grown):
            smaller = which == action and set(fewer) < set(literals)
            if smaller and other not in body.retired:
                part.append(first + 2 * other)
        closures = graph.up([first + 2 * place]), graph.up(part)
        whole, rest = guaranteed(closures)[:, : 2 * self._own]
        return None if (whole & ~rest).any() else place

    def retire(self, body: Body, snapshot: Snapshot, place: int) -> None:
        """Let a snapshot forget a sensor that a body has retired."""
        snapshot.silence(body.first_grown + place)
        self._grower.retire(body.grown[place])
        self._fit(body)

    def _members(self, context: Context) -> list[int]:
        """Return the literals of the single contexts that make one of several."""
        body, (action, literals) = self._body, context
        first = self._own + len(body.actions)
        return [2 * (first + body.context.index((action, a))) for a in literals]
