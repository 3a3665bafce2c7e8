"""All that an agent has learned: its snapshot, its body, its experience.

It is the same in one process and in a swarm, where the coordinator has it: so the same
observations lead to the same births.
"""

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.growth import Growth, apply_change
from neurosnap.agent.growth_in_decisions import Context, body_after
from neurosnap.poc.learning.archive import (
    Arrays,
    entry,
    pack_arrays,
    rows_in,
    unpack_arrays,
)
from neurosnap.poc.learning.history_questions import Search, nothing
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium, selection
from neurosnap.wire import Decision

if TYPE_CHECKING:
    from neurosnap.poc.order.graph import PocGraph

_NO_HISTORY = History(0, 64)
_OFTEN = 0.5  # the share of unforeseen results from which on they are told


class AgentMemory:
    """The memory of an agent, updated at each step.

    Args:
        body: What is sensed and done at first. If it has room, sensors are grown.
        imagines: Whether its policy imagines, and has to know what was met.

    Attributes:
        body: What is sensed by now.
        experience: What a policy that imagines has to know; None if it does not.
        decision: The last one that was followed.

    Raises:
        InvalidValueError: It imagines, or grows, and senses actions of which there are
            none.
    """

    def __init__(self, body: Body, imagines: bool = False) -> None:
        self.body = body
        self.experience = Experience(body) if imagines else None
        self.decision = Decision(0, -1, "the run begins")
        self._growth = Growth(body) if body.room else None
        self._begins = False  # the observation whose state is to come
        self._graph: PocGraph | None = None  # what was believed before it
        self._actions = self._of(body)

    def _of(self, body: Body) -> Actions | None:
        """Return the actions of a body, if anything follows from them."""
        return None if self.is_empty or not body.senses_actions else Actions(body)

    @property
    def chance(self) -> dict[str, dict[str, float]]:
        """Return by action what it leads to unforeseen, and how often; see `Agent`."""
        if self._growth is None or not self.body.context:
            return {}
        shares, hopeless = self._growth.surprising, self._growth.hopeless
        name = Sensorium(self.body.own).name
        told = {
            action: {
                name(a): round(float(mine[a]), 2)
                for a in np.flatnonzero((mine >= _OFTEN) | left).tolist()
            }
            for action, mine, left in zip(
                self.body.actions, shares, hopeless, strict=True
            )
        }
        return {action: results for action, results in told.items() if results}

    @property
    def history(self) -> History:
        """The last readings of every sensor, where sensors are grown."""
        return _NO_HISTORY if self._growth is None else self._growth.history

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to know."""
        return self.experience is None and self._growth is None

    def observe(
        self,
        action: int,
        begins: bool,
        observation: NDArray[np.bool_],
        known: NDArray[np.bool_] | None,
        snapshot: Snapshot,
    ) -> Search[None]:
        """Hold an observation against what was believed, before it is learned.

        Args:
            action: That of the last decision; -1: none was taken.
            begins: The observation begins a trajectory and follows no action.
            observation: ``(N,)``.
            known: ``(N,)``, which of it is known; if None, all.
            snapshot: Has the state before it, and what is believed; weighs what is
                born.

        Returns:
            What is to be done once the observation is learned and before `settle`: the
            history of the readings, which has it by now, is asked.
        """
        own, told, state = 2 * len(self.body.own), self.experience, snapshot.state
        self._graph = None if told is None else snapshot.poc_graph()
        foretold = np.zeros(own, np.bool_)
        if self._actions is not None and action >= 0 and not begins:
            signal = self._actions.signal(action, self._actions.hold(state))
            closure = snapshot.poc_graph().up(signal)
            bound = guaranteed([closure])[0]
            foretold = self.body.carried(state, bound)[:own]
            if told is not None:
                came = selection(observation, known)[:own]
                told.count_trial(action, state, foretold, came)
        if told is not None and action >= 0:
            told.leave(state, begins, action)
        self._begins = begins
        if self._growth is None:
            return nothing()
        self._growth.record(observation, known, begins, ended=begins and action >= 0)
        step = (-1 if begins else action, state)
        return self._growth.notice(*step, foretold, observation, known, snapshot)

    def settle(self, state: NDArray[np.bool_], snapshot: Snapshot) -> None:
        """Remember the state of the observation, ``(2N,)``, which is learned by now."""
        told, begins, self._begins = self.experience, self._begins, False
        if told is None:
            return
        told.meet(state)
        if snapshot.poc_graph() is not self._graph:
            told.no_way.clear()
        if begins:
            told.begin(state)
        if self._growth is not None:
            told.history = self._growth.history
            told.give_up(self._growth.hopeless)

    @property
    def changes(self) -> dict[str, Any]:
        """What a tick's decision says of growth, by field."""
        return {} if self._growth is None else self._growth.changes

    def follow(self, decision: Decision, snapshot: Snapshot) -> bool:
        """Apply the grown or retired sensor of a decision to body and snapshot.

        Returns:
            Whether any sensor came or went.

        Raises:
            MessageError: It cannot be said of this body.
        """
        self.decision = decision
        body = body_after(self.body, decision)
        if body is self.body:
            return False
        self.body = body
        apply_change(body, decision, snapshot)
        self._actions = self._of(body)
        if self._growth is not None:
            self._growth.fit(body)
        if self.experience is not None:
            self.experience.looked_at = body.looked_at
        self.settle(snapshot.state, snapshot)  # what is born holds now
        return True

    def to_bytes(self) -> bytes:
        """Return all of it, for a key-frame; nothing where there is nothing to know."""
        return b"" if self.is_empty else pack_arrays(self._arrays())

    def _arrays(self) -> Arrays:
        followed = _Followed(self.decision, self.body.grown, self.body.retired)
        text = np.frombuffer(msgspec.json.encode(followed), np.uint8)
        arrays: Arrays = {"followed": text}
        if self.experience is not None:
            arrays |= self.experience.arrays()
        return arrays if self._growth is None else arrays | self._growth.arrays()

    def restore(self, data: bytes) -> None:
        """Restore the whole state from the bytes of `to_bytes`.

        Raises:
            ValueError: It is damaged, or of another agent.
        """
        if not data and self.is_empty:
            return
        arrays = unpack_arrays(data)
        followed = _followed_in(arrays)
        self.decision, self.body = followed.decision, followed.body(self.body)
        self._actions = self._of(self.body)
        if self.experience is not None:
            self.experience.restore(arrays)
            self.experience.looked_at = self.body.looked_at
        if self._growth is not None:
            self._growth.fit(self.body)
            self._growth.restore(arrays)
            if self.experience is not None:
                self.experience.give_up(self._growth.hopeless)


def body_in(body: Body, data: bytes) -> Body:
    """Return the body that a key-frame's agent has, in a run that began with `body`.

    Raises:
        ValueError: It is damaged, or of another agent.
    """
    return _followed_in(unpack_arrays(data)).body(body) if data else body


class _Followed(msgspec.Struct, frozen=True):
    """The decisions that were followed, as far as they are not followed again."""

    decision: Decision
    """The last one, whole: what it said of growth may be said again."""
    grown: tuple[Context, ...]
    retired: tuple[int, ...]

    def body(self, body: Body) -> Body:
        """Return a body with what was grown by now, and nothing else."""
        return msgspec.structs.replace(body, grown=self.grown, retired=self.retired)


def _followed_in(arrays: Arrays) -> _Followed:
    """Return what was followed."""
    text = entry(arrays, "followed", (rows_in(arrays, "followed"),), np.uint8)
    try:
        return msgspec.json.decode(text.tobytes(), type=_Followed)
    except msgspec.DecodeError as error:
        raise ValueError(f"followed: {error}") from error
