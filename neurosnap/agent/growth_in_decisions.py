"""Reads from a decision which sensors were grown and which were retired.

`Context` is what makes a grown sensor be on.

Cell processes import this module: it needs neither numpy nor numba.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.wire import Decision

if TYPE_CHECKING:
    from neurosnap.agent.body import Body


class Context(NamedTuple):
    """What makes a grown sensor be on: an action where literals held, or the past.

    A *window* takes no action: it is on iff all its literals were read at each of some
    of the last ticks. A *latch* takes none, either: it is on from when its literal was
    read until its `reset` is, and not its literal. Nor does a *clone*, one of several
    places that may look alike: it is on where its literals are read and one of its ways
    led, and where all other clones of its map are off.
    """

    action: int
    """The action that was taken; -1: it is a window, a latch or a clone."""
    literals: tuple[int, ...]
    """Ascending: of the world's own sensors; or that an action or a contextual sensor,
    one that was grown before say, was on the step before."""
    since: int = 0
    """How many ticks before this one a window begins."""
    until: int = 0
    """How many before this one it ends."""
    reset: int = -1
    """The literal that ends a latch; -1: it is none."""
    ways: tuple[int, ...] = ()
    """Of a clone: an action, the number of a clone it leads here from, and so on."""
    among: tuple[int, ...] = ()
    """Of a clone: the number of the first of its map, and how many these are."""

    def includes(self, other: "Context") -> bool:
        """Return whether it is on only if another one of the same action is, too."""
        wider = self.since >= other.since and self.until <= other.until
        same = self.action == other.action and self[4:] == other[4:]
        return same and wider and {*self.literals} >= {*other.literals}


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


def context_in(decision: Decision) -> Context:
    """Return the context of the sensor that a decision grows."""
    past = decision.since, decision.until, decision.reset
    clone = decision.ways, decision.among
    return Context(decision.context, decision.literals, *past, *clone)


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
            body = body.grow(context_in(decision))
        if decision.retires >= 0:
            body = body.retire(decision.retires - body.first_grown)
    except InvalidValueError as error:
        raise MessageError(f"decision: {error}") from error
    return body
