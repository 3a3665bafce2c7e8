"""Refuses grown sensors that a body cannot have, each kind by its rule."""

from itertools import pairwise
from typing import TYPE_CHECKING

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.agent.body import Body

OLDEST = 63
"""How many ticks back a window may begin."""


def check_grown(body: "Body") -> None:
    """Refuse a body with a grown sensor that it cannot have; see `Context`.

    Raises:
        InvalidValueError: There is one, or there are more than there is room for.
    """
    if len(body.grown) > body.room:
        rule = f"must be at most {body.room}, for which there is room"
        raise InvalidValueError("grown", rule, len(body.grown))
    single = set(body.context)
    latches = {
        body.first_grown + place
        for place, each in enumerate(body.grown)
        if each.reset >= 0
    }
    for place, context in enumerate(body.grown):
        action, literals, since, until, reset, ways, among = context
        if not body.context:
            _check_window(body, context)
            continue
        if ways or among:
            _check_clone(body, context, place)
            continue
        if reset >= 0:
            _check_latch(context, body.first_grown + place)
            continue
        ascends = all(a >> 1 < b >> 1 for a, b in pairwise(literals))
        now, before = body.split(literals)
        if len(now) + 2 * len(before) < 2 or not ascends:
            rule = "must be of literals of two or more sensors, ascending"
            raise InvalidValueError("grown", rule, (action, literals))
        if not single.issuperset((action, literal) for literal in now):
            rule = "must be of literals that are sensed in the action's context"
            raise InvalidValueError("grown", rule, (action, literals))
        off = any(a & 1 and a >> 1 not in latches for a in before)
        if off or any(a >= 2 * (body.first_grown + place) for a in before):
            rule = "must say of the step before what was on, of earlier sensors"
            raise InvalidValueError("grown", rule, (action, literals))
        if not 0 <= action < len(body.actions) or since or until:
            rule = f"must be of one of {len(body.actions)} actions, and no window"
            raise InvalidValueError("grown", rule, context)


def _check_latch(latch: Context, number: int) -> None:
    action, literals, since, until, reset, *_ = latch
    earlier = all(0 <= a < 2 * number for a in (*literals, reset))
    two = len(literals) == 1 and literals[0] != reset
    if action >= 0 or since or until or not (earlier and two):
        rule = "must be a latch of two literals of earlier sensors, without an action"
        raise InvalidValueError("grown", rule, latch)


def _check_clone(body: "Body", clone: Context, place: int) -> None:
    action, literals, *others, ways, among = clone
    first, size = among if len(among) == 2 else (-1, 0)
    number, several = body.first_grown + place, range(first, first + size)
    earlier = body.grown[first - body.first_grown : place]
    if (
        number not in several
        or first < body.first_grown
        or several.stop > body.count
        or any(each.among != among for each in earlier)
    ):
        rule = "must be the next of its map, for all of which there is room"
        raise InvalidValueError("grown", rule, clone)
    own = all(0 <= a < 2 * len(body.own) for a in literals)
    ascends = all(a >> 1 < b >> 1 for a, b in pairwise(literals))
    alike = {(*(a >> 1 for a in each.literals),) for each in (*earlier, clone)}
    if not (own and ascends and literals and len(alike) == 1):
        rule = "must be of own literals, ascending, of the same sensors as its map"
        raise InvalidValueError("grown", rule, clone)
    led = [
        (way, sensor)
        for each in (*earlier, clone)
        for way, sensor in zip(each.ways[::2], each.ways[1::2], strict=False)
    ]
    if (
        len(ways) % 2
        or any(not 0 <= way < len(body.actions) for way, _ in led)
        or any(sensor not in several for _, sensor in led)
        or len(set(led)) < len(led)
    ):
        rule = "must be led to by actions from its map, by each from each to but one"
        raise InvalidValueError("grown", rule, clone)
    if action >= 0 or others != [0, 0, -1]:
        rule = "must be a clone without an action, a window or a reset"
        raise InvalidValueError("grown", rule, clone)


def _check_window(body: "Body", window: Context) -> None:
    action, literals, since, until, *others = window
    ascends = all(a >> 1 < b >> 1 for a, b in pairwise(literals))
    own = all(0 <= a < 2 * len(body.own) for a in literals)
    plain = action < 0 and others == [-1, (), ()]
    if not (ascends and own and len(literals) + since > 1 and plain):
        rule = "must be of own literals, ascending, of no action, several or of past"
        raise InvalidValueError("grown", rule, window)
    if not 0 <= until <= since <= OLDEST:
        rule = f"must begin up to {OLDEST} ticks ago, and not end before it begins"
        raise InvalidValueError("grown", rule, window)
