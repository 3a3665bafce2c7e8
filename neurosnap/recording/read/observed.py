"""What the world's own sensors read in a recorded run, and when."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.protocol.observations import readings
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of

_SECOND = 1e9


class Observed(NamedTuple):
    """An observation of the world's own sensors."""

    at: float
    """When it was sent, seconds since 1970."""
    on: NDArray[np.bool_]
    """``(n,)``, which are on."""
    known: NDArray[np.bool_]
    """``(n,)``, which readings are known. While learning is paused none is."""
    begins: bool = False
    """Nobody listened before it."""


def as_observed(message: wire.Observation, sent: int, body: Body) -> Observed:
    """Return what a message says.

    Args:
        message: Of a run with that body.
        sent: Nanoseconds since 1970.
        body: What is sensed.

    Raises:
        ShapeError: It is of another number of sensors.
    """
    own = len(body.own)
    bits, known = readings(message, body.count)
    told = np.ones(own, np.bool_) if known is None else known[:own]
    if message.paused:
        told = np.zeros(own, np.bool_)
    return Observed(sent / _SECOND, bits[:own], told, message.begins)


def observations(recording: Recording) -> Iterator[tuple[int, Observed]]:
    """Yield the observations of a recorded run, each after its tick.

    Raises:
        RecordingError: While iterating: the recording is damaged, or not a run's.
    """
    body = options_of(recording).body
    for message, _, _, sent, _ in recording.messages(("observe",)):
        if isinstance(message, wire.Observation):
            yield message.tick, as_observed(message, sent, body)
