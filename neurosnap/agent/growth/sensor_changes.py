"""Grows and retires the sensors of a snapshot, as a decision says.

A decision carries all it takes, so that a reader of a run learns of a birth what
the run did, without its history.
"""

from collections.abc import Iterator

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.agent.growth.changed import Changed
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.poc.learning.history import Newborn
from neurosnap.poc.learning.kinds import EmpiricalSnapshot, Snapshot
from neurosnap.wire import Decision


def changes_in(decision: Decision, body: Body) -> Iterator[Changed]:
    """Yield what a decision says of sensors that come or go.

    Args:
        decision: The decision.
        body: What is sensed after it.
    """
    for sensor, retires in ((decision.born, False), (decision.retires, True)):
        if 0 <= sensor < body.size:
            yield Changed(decision.tick, sensor, body.sensors[sensor], retires)


def body_after(body: Body, decision: Decision) -> Body:
    """Return the body that is read from the observation on that follows a decision.

    Args:
        body: That which is read up to the decision.
        decision: Says what changes, if anything does.

    Raises:
        MessageError: It cannot be said of this body.
    """
    due = body.first_grown + len(body.grown)
    if decision.born not in (-1, due):
        rule = f"must be sensor {due}"
        raise MessageError(f"decision: born: {rule}, got {decision.born}")
    try:
        if decision.born >= 0:
            body = body.grow((decision.context, decision.literals))
        if decision.retires >= 0:
            body = body.retire(decision.retires - body.first_grown)
    except InvalidValueError as error:
        raise MessageError(f"decision: {error}") from error
    return body


def apply_change(body: Body, decision: Decision, snapshot: Snapshot) -> None:
    """Let a snapshot go on as a decision says.

    Args:
        body: That follows from the decision.
        decision: The decision.
        snapshot: As it was when the decision was taken.

    Raises:
        MessageError: What is said of a newborn is not of the sensors before it.
    """
    if decision.born >= 0:
        sensor = decision.born
        kind = "<u4" if isinstance(snapshot, EmpiricalSnapshot) else "<f8"
        try:
            squares = np.frombuffer(decision.weights, kind).reshape(4, sensor)
            codes = np.frombuffer(decision.codes, np.uint8)
            newborn = Newborn(decision.history, squares, codes)
            reads = body.reading(body.grown[-1], snapshot.state)
            snapshot.grow(sensor, body.sensors[sensor], newborn, reads)
        except ValueError as error:
            raise MessageError(f"decision: born: {error}") from error
    if decision.retires >= 0:
        snapshot.silence(decision.retires)


def birth_fields(newborn: Newborn, snapshot: Snapshot) -> dict[str, int | bytes]:
    """Return what a decision says of a newborn, by field."""
    kind = "<u4" if isinstance(snapshot, EmpiricalSnapshot) else "<f8"
    return {
        "history": newborn.ticks,
        "weights": newborn.squares.astype(kind).tobytes(),
        "codes": newborn.codes.tobytes(),
    }
