"""Sensors that a script grows at given ticks."""

from collections.abc import Sequence
from typing import Annotated

import msgspec

from neurosnap.agent.body import Body, Scripted
from neurosnap.errors import InvalidValueError, UnknownSensorError
from neurosnap.sensorium import Sensorium


class Birth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A sensor to be grown: an action where several sensations hold."""

    action: str
    """The action's name."""
    literals: tuple[str, ...]
    """Two sensors of the world's own or more, with a star for one that is off."""
    tick: Annotated[int, msgspec.Meta(ge=0)] = 0
    """After which tick it is grown; 0: it is there from the start."""


def with_births(body: Body, births: Sequence[Birth]) -> Body:
    """Return a body that grows some sensors by a script, with more room for them.

    Args:
        body: With the actions in context, before anything is grown.
        births: In the order in which those of the same tick are grown, one at a tick.

    Raises:
        InvalidValueError: One names an action or a literal that there is not, or is of
            less than two sensors, or the same as another.

    Example:
        >>> body = Body.full(["door", "dark"], ["push"])
        >>> with_births(body, [Birth("push", ("door", "dark*"))]).sensors[-1]
        'push&door&~dark'
    """
    if births and not body.context:
        rule = "must go with a planner or an excited agent, and with actions to take"
        raise InvalidValueError("births", rule, len(births))
    scripted: list[Scripted] = []
    for place, birth in enumerate(births):
        name = f"births[{place}]"
        if birth.action not in body.actions:
            rule = f"must be one of {', '.join(body.actions)}"
            raise InvalidValueError(f"{name}.action", rule, birth.action)
        action = body.actions.index(birth.action)
        context = action, _literals(body, action, birth, name)
        for earlier, (_, other) in enumerate(scripted):
            if other == context:
                rule = f"must be another sensor than births[{earlier}]"
                raise InvalidValueError(f"{name}.literals", rule, birth.literals)
        scripted.append((birth.tick, context))
    return msgspec.structs.replace(
        body,
        room=body.room + len(scripted),
        grown=(*body.grown, *(context for tick, context in scripted if tick == 0)),
        scripted=(*body.scripted, *scripted),
    )


def _literals(body: Body, action: int, birth: Birth, name: str) -> tuple[int, ...]:
    """Return the literals of a birth, ascending."""
    sensorium, literals = Sensorium(body.own), set[int]()
    for number, text in enumerate(birth.literals):
        each = f"{name}.literals[{number}]"
        try:
            literal = sensorium.literal(text)
        except UnknownSensorError as error:
            rule = "must name a sensor of the world's own, or one with a star"
            raise InvalidValueError(each, rule, text) from error
        if (action, literal) not in body.context:
            rule = "must be of a sensor that looks back no step"
            raise InvalidValueError(each, rule, text)
        if literal ^ 1 in literals:
            rule = "must not be the complement of another one"
            raise InvalidValueError(each, rule, text)
        literals.add(literal)
    if len(literals) < 2:
        rule = "must be of two sensors or more"
        raise InvalidValueError(f"{name}.literals", rule, birth.literals)
    return tuple(sorted(literals))
