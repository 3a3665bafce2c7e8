"""Fits an agent to a source: its sensors, its actions, its target."""

from collections.abc import Mapping

from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.errors import InvalidValueError
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Argument, Source


def body_of(source: Source, agent: AgentKind, room: int = 0) -> Body:
    """Return the body of an agent for a source.

    A walker does what it does without regard to what it leads to, and gets the world's
    own sensors alone; the others sense their actions, too, in every context.

    Args:
        source: What there is to sense and to do.
        agent: The kind of agent.
        room: How many sensors may be grown: of a walker's, windows of the last ticks.
    """
    own, orders, actions = source.sensors, source.orders, source.actions
    if agent == "walker":
        return Body(own=own, orders=orders, actions=actions, room=room)
    return Body.full(own, actions, orders, room)


def drawn_to(
    name: str, seed: int, arguments: Mapping[str, Argument], target: str | None
) -> dict[str, Argument]:
    """Return the arguments that give a world the sensors `better` and `worse`.

    Args:
        name: The source.
        seed: As in `open_source`.
        arguments: What the world is given besides.
        target: The place to get to; if None, the world's own where it has those
            sensors, or one that it draws.

    Raises:
        InvalidValueError: The target is no place, or there is no such source.
    """
    if target is not None:
        if not target.isdecimal():
            rule = "must be the number of a place for an excited agent"
            raise InvalidValueError("target", rule, target)
        return {"target": int(target)}
    plain = open_source(name, seed, arguments)
    plain.close()
    has_drive = {"better", "worse"}.issubset(plain.sensors)
    return {} if has_drive or not plain.actions else {"target": "drawn"}
