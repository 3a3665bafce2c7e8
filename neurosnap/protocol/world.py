"""The world's side of the protocol: each decision is answered by an observation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.check_grown import OLDEST
from neurosnap.agent.growth_in_decisions import body_after
from neurosnap.errors import InvalidValueError, MessageError, ShapeError
from neurosnap.protocol.resume_point import seen_after
from neurosnap.sensorium import pack, unpack

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from neurosnap.agent.body import Body
    from neurosnap.protocol.resume_point import ResumePoint
    from neurosnap.sources.protocol import Observed, Source


class World:
    """The world's logic: answers each decision with what its agent observes next.

    Args:
        source: Where observations come from; the caller closes it.
        body: What is made of them.
        past: For a run that is resumed: the source is brought to where it was, unless
            it is live: then it says itself whether what it shows next follows an action
            of the run.
        known: With a live source and a `past`: which of its readings were known then;
            None if all were.
    """

    def __init__(
        self,
        source: Source,
        body: Body,
        past: ResumePoint | None = None,
        known: NDArray[np.bool_] | None = None,
    ) -> None:
        self._source = source
        if past is not None:
            body = past.body(body)
        self._body, self._senses = body, Senses(body, known)
        self._actions = len(body.actions)
        self._literals = 2 * len(body.sensors)
        self._tick = 0  # of the last observation
        self._answered = -1  # the tick of the last decision taken up
        self._state: NDArray[np.bool_] | None = None
        self._recorded = 0  # the tick of that state
        self._began = past is not None
        if past is not None:
            self._resume(past)

    def _resume(self, past: ResumePoint) -> None:
        if not self._source.live:
            seen, (first, expected), checksum = self._source.first(), past.seen, 0
            for tick in range(1, past.tick + 1):
                if tick > 1:
                    seen = self._source.step(past.actions[tick - 2])
                if seen is None:
                    continue
                if 0 < first <= tick:
                    known = b"" if seen.known is None else pack(seen.known)
                    checksum = seen_after(checksum, pack(_bits(seen)), known)
                if past.tick - tick <= OLDEST:  # no window looks further back
                    self._senses.observe(_bits(seen), seen.known, begins=seen.begins)
            is_file = not (self._actions or self._body.room)
            if first and is_file and checksum != expected:
                rule = f"must have read at ticks {first} to {past.tick} as recorded"
                raise InvalidValueError("source", rule, "other readings")
        self._tick, self._answered = past.tick, past.tick - 1
        self._state = unpack(past.state, self._literals)
        self._recorded = past.tick

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics it has to receive."""
        return ("state", "decision") if self._senses.looks_back else ("decision",)

    def receive(self, message: wire.Message) -> wire.Decision | None:
        """Receive a message; return it if it is a decision to be answered.

        A decision that came before changes nothing.

        Raises:
            MessageError: It cannot be right.
        """
        match message:
            case wire.State() if message.tick == self._tick:
                try:
                    self._state = unpack(message.literals, self._literals)
                except ShapeError as error:
                    raise MessageError(f"state: {error}") from error
                self._recorded = message.tick
            case wire.Decision() if message.tick > self._answered:
                free = self._tick == 0 or not self._actions
                fits = free or 0 <= message.action < self._actions
                if message.tick > self._tick or not fits:
                    rule = f"must be for tick {self._tick}, of {self._actions} actions"
                    raise MessageError(f"decision: {f'{rule}, got {message}':.200}")
                if self._senses.looks_back and self._recorded < self._tick:
                    # What would be sensed in context would be wrong.
                    rule = f"must come after the state of tick {self._tick}"
                    got = f"that of {self._recorded}"
                    raise MessageError(f"decision: {rule}, got {got}")
                body = body_after(self._body, message)
                if body is not self._body:
                    self._body = body
                    self._senses.fit(body)
                self._answered = message.tick
                return message
            case _:
                pass
        return None

    def answer(self, decision: wire.Decision) -> wire.Observation | None:
        """Return the observation that follows a decision; None if the source is over.

        With a live source it takes as long as that does.

        Raises:
            InvalidValueError: The source says that it knows nothing: no wave could
                start of that, and the run would wait for one.
        """
        source = self._source
        seen = source.step(decision.action) if self._began else source.first()
        if seen is None:
            return None
        if seen.known is not None and not seen.known.any():
            name = f"source: known readings at tick {self._tick + 1}"
            raise InvalidValueError(name, "must be 1 at least", 0)
        self._began = True
        self._tick += 1
        step = decision.action, self._state, seen.begins
        bits, known = self._senses.observe(_bits(seen), seen.known, *step)
        return wire.Observation(
            tick=self._tick,
            bits=pack(bits),
            begins=seen.begins,
            known=b"" if known is None else pack(known),
            cut=seen.cut and self._tick > 1,
            received=seen.received,
            outages=seen.outages,
            at=seen.at,
            said=seen.said,
            due=seen.due,
            waiting=seen.waiting,
        )


def _bits(seen: Observed) -> NDArray[np.bool_]:
    """Return what was read; what is unknown is off."""
    return seen.bits if seen.known is None else seen.bits & seen.known
