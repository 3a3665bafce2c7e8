"""Lists the sensors that a run has grown, from its decisions and key-frames."""

from itertools import chain

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Changed, body_after
from neurosnap.agent.memory import body_in
from neurosnap.errors import MessageError, RecordingError
from neurosnap.recording.read.recording import Recording


class RecordedBirth(msgspec.Struct, frozen=True, kw_only=True):
    """A sensor that was grown."""

    tick: int
    """The tick whose decision grew it: it is read from the next observation on."""
    sensor: int
    """Its number, which stays."""
    name: str
    """Its formula: an action, and the literals that must have held before it."""
    history: int | None
    """How many ticks its weights came from; None if that is not recorded."""
    exact: bool = True
    """Whether the tick is known; if not, `tick` is that of the first key-frame that has
    the sensor, and it was grown then or before."""
    retired: int | None = None
    """The tick whose decision retired it, or of the first key-frame in which it has;
    None if it is read still."""
    believed: str = ""
    """What it is believed from, if nothing reads it; empty: it is read."""


class Births:
    """Lists the sensors that a run grows, message by message.

    Attributes:
        first: What is sensed when the run starts.
        body: What is sensed by now.
        listed: What was grown by now, in order.
    """

    def __init__(self, body: Body) -> None:
        self.first = body
        self._tick = 0
        self.body = body
        self.listed: tuple[RecordedBirth, ...] = ()

    def follow(self, message: wire.Decision | wire.KeyFrame) -> None:
        """Follow a message. Those of the coordinator come in its order.

        What follows a gap is left to the next key-frame.

        Raises:
            ValueError: A key-frame holds no agent of this run.
        """
        if isinstance(message, wire.KeyFrame):
            exact = message.tick <= self._tick + 1
            body = body_in(self.first, message.agent)
            history = None
        elif message.tick <= self._tick:  # said again where a run goes on
            return
        else:
            exact, history = True, message.history
            try:
                body = body_after(self.body, message)
            except MessageError:
                return
        self._follow_body(body, message.tick, history, exact)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all sensors there are by now, by number."""
        return self.body.sensors[: self.body.size]

    @property
    def room(self) -> int:
        """How many sensors may still be grown."""
        return self.body.room - len(self.body.grown)

    def at(self, tick: int) -> tuple[RecordedBirth, ...]:
        """Return the sensors grown by a tick, as known at that tick."""
        return tuple(
            birth
            if birth.retired is None or birth.retired <= tick
            else msgspec.structs.replace(birth, retired=None)
            for birth in self.listed
            if birth.tick <= tick
        )

    def changes(self) -> list[Changed]:
        """Return what was grown and retired by now, by tick."""
        grown = [Changed(b.tick, b.sensor, b.name, False) for b in self.listed]
        retired = [
            Changed(b.retired, b.sensor, b.name, True)
            for b in self.listed
            if b.retired is not None
        ]
        return sorted((*grown, *retired), key=lambda change: change.tick)

    def read_at(self, tick: int) -> list[int]:
        """Return the numbers of the sensors that are read after a tick."""
        grown = self.at(tick)
        gone = {birth.sensor for birth in grown if birth.retired is not None}
        there = range(self.body.first_grown + len(grown))
        return [sensor for sensor in there if sensor not in gone]

    def _follow_body(
        self, body: Body, tick: int, history: int | None, exact: bool
    ) -> None:
        self._tick = max(self._tick, tick)
        before = self.body
        if len(body.grown) < len(before.grown) or body == before:
            return
        self.body, first, names = body, body.first_grown, body.sensors
        gone = {first + place for place in body.retired} - {
            first + place for place in before.retired
        }
        new = (
            RecordedBirth(
                tick=tick,
                sensor=sensor,
                name=names[sensor],
                believed=body.believed(sensor),
                history=history,
                exact=exact,
            )
            for sensor in range(before.size, body.size)
        )
        self.listed = tuple(
            msgspec.structs.replace(birth, retired=tick)
            if birth.sensor in gone
            else birth
            for birth in (*self.listed, *new)
        )


def births_of(recording: Recording) -> Births:
    """Return the sensors that a recorded run has grown.

    Cost: reading every decision and key-frame, where there is room for any sensor.

    Raises:
        RecordingError: The recording is damaged or not a run's, or a key-frame holds no
            agent of it.
    """
    births = Births(recording.options.body)
    if births.body.room:
        closing = () if recording.closing is None else (recording.closing,)
        several = (one.message for one in recording.messages(("decision", "keyframe")))
        for message in chain(several, closing):
            if not isinstance(message, wire.Decision | wire.KeyFrame):
                continue
            try:
                births.follow(message)
            except ValueError as error:
                place = f"{recording.path}: key-frame of tick {message.tick}"
                raise RecordingError(f"{place}: must hold an agent, {error}") from error
    return births
