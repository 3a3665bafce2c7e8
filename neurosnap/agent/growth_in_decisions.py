"""Reads from a decision which sensors were grown and which were retired.

Cell processes import this module: it needs neither numpy nor numba.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.wire import Decision

if TYPE_CHECKING:
    from neurosnap.agent.body import Body


class Changed(msgspec.Struct, frozen=True):
    """A sensor that was grown or retired, in the form that is reported."""

    tick: int
    """The tick whose decision says so; it is so from the next observation on."""
    sensor: int
    """Its number."""
    name: str
    """Its formula."""
    retires: bool = False
    """Whether it is read no more; else it was grown."""


def changes_in(decision: Decision, body: "Body") -> Iterator[Changed]:
    """Yield the sensors a decision grows or retires; the body is the one after it."""
    for sensor, retires in ((decision.born, False), (decision.retires, True)):
        if 0 <= sensor < body.size:
            yield Changed(decision.tick, sensor, body.sensors[sensor], retires)


def body_after(body: "Body", decision: Decision) -> "Body":
    """Return the body that is read from the observation on that follows a decision.

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
