"""What every part of a swarm does: decode messages, work, and announce its end."""

from collections.abc import Awaitable, Iterable
from typing import TypeVar

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.fabric.protocol import Fabric

T = TypeVar("T")

_SHOWN = 400  # characters of a fault; what is wrong with a message may quote all of it


async def take_part(fabric: Fabric, work: Awaitable[T]) -> T:
    """Await `work` inside an entered fabric, then say the part's last word.

    A part that fails says why, as a `Fault`, before its last word: the recording then
    holds the reason. A cancelled part says nothing: it has no time left.
    """
    try:
        result = await work
    except Exception as error:
        # In one go, so that nothing of its own comes between: it shows who failed.
        fault = wire.Fault(fabric.who, f"{type(error).__name__}: {error}")
        fabric.publish(fault, wire.Leave(fabric.who))
        raise
    fabric.publish(wire.Leave(fabric.who))
    return result


def decoded(fabric: Fabric, deliveries: Iterable[wire.Delivery]) -> list[wire.Message]:
    """Return the messages in a burst; what is none is reported and dropped."""
    messages: list[wire.Message] = []
    for delivery in deliveries:
        try:
            messages.append(wire.decode(delivery.key, delivery.payload))
        except MessageError as error:
            fabric.publish(wire.Fault(fabric.who, f"{error!s:.{_SHOWN}}"))
    return messages
