"""Reads implications such as "a < b*" and makes the graph of them.

A generated order must keep every literal apart from its own complement, and a strict
relation must stay strict: what breaks that is refused ([GK] example:generators and
relations).
"""

import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import as_literal
from neurosnap.sensorium import Sensorium

Sign: TypeAlias = Literal["<", "<=", "="]

RelationLike: TypeAlias = (
    tuple[int | str, int | str] | tuple[int | str, str, int | str] | str
)
"""``(a, b)`` for ``a <= b``, ``(a, sign, b)``, or text such as ``"a < b <= c*"``."""

_SIGNS: dict[str, Sign] = {"<": "<", "<=": "<=", "≤": "<=", "=": "="}
_SPLIT = re.compile(r"(<=|≤|<|=)")


class OrderRelation(NamedTuple):
    """One relation between two literals.

    Attributes:
        low: The literal on the left.
        sign: ``"<"`` (below, and not equal), ``"<="`` or ``"="``.
        high: The literal on the right.
    """

    low: int
    sign: Sign
    high: int


def split_text(text: object) -> tuple[Sensorium, list[str]]:
    """Return the generators and the relations of ``"a, b : a < b"``, still as text.

    Raises:
        InvalidValueError: It is no text, or a generator is no name.

    Examples:
        >>> split_text("a, b : a<b, b<=a")
        (Sensorium(['a', 'b']), ['a<b', 'b<=a'])
    """
    if not isinstance(text, str):
        rule = 'must be text such as "a, b : a < b"'
        raise InvalidValueError("poc set", rule, text)
    before, _, after = text.partition(":")
    names = [name.strip() for name in before.split(",")] if before.strip() else []
    for name in names:
        if _SPLIT.search(name):
            rule = "must hold no <, ≤ or =; relations follow a colon"
            raise InvalidValueError("generator", rule, name)
    return Sensorium(names), [part.strip() for part in after.split(",") if part.strip()]


def read_relations(
    sensorium: Sensorium, relations: Iterable[RelationLike]
) -> list[OrderRelation]:
    """Return relations with their literals as numbers.

    Args:
        sensorium: Whose literals.
        relations: Pairs ``(a, b)``, meaning ``a <= b``; triples ``(a, sign, b)``; or
            text, in which chains such as ``"a < b < c"`` are one relation a sign.

    Raises:
        UnknownSensorError: A name or a literal is not in the sensorium.
        InvalidValueError: An entry is none of these.

    Examples:
        >>> read_relations(Sensorium(["a", "b"]), ["a < b*"])
        [OrderRelation(low=0, sign='<', high=3)]
        >>> read_relations(Sensorium(["a", "b"]), [(2, 0)])
        [OrderRelation(low=2, sign='<=', high=0)]
    """
    if isinstance(relations, str):
        rule = "must be several, not one text; PocSet.parse reads one"
        raise InvalidValueError("relations", rule, relations)
    found: list[OrderRelation] = []
    for entry in relations:
        for low, sign, high in _parts(entry):
            if sign not in _SIGNS:
                raise InvalidValueError("relation sign", "must be <, <= or =", sign)
            pair = element(sensorium, low), element(sensorium, high)
            found.append(OrderRelation(pair[0], _SIGNS[sign], pair[1]))
    return found


def element(sensorium: Sensorium, name: int | str) -> int:
    """Return a literal that is given by its name or its number.

    Raises:
        UnknownSensorError: It is not in the sensorium.
    """
    if isinstance(name, str):
        return sensorium.literal(name)
    return as_literal("literal", name, 2 * len(sensorium))


def generated(sensorium: Sensorium, relations: Sequence[OrderRelation]) -> PocGraph:
    """Return the graph of relations, once they are known to contradict nothing.

    O(N³/16) time, for the closure.

    Raises:
        InvalidValueError: They make a literal equal to its complement, or a strict
            relation part of a cycle; the literal or the relation is named.

    Examples:
        >>> names = Sensorium(["a", "b"])
        >>> generated(names, read_relations(names, ["a < b < a"]))
        Traceback (most recent call last):
            ...
        neurosnap.errors.InvalidValueError: relations: must have no cycle through a \
strict one, got 'a < b'
    """
    pairs = [(low, high) for low, _, high in relations]
    pairs += [(high, low) for low, sign, high in relations if sign == "="]
    try:
        graph = PocGraph.from_implications(len(sensorium), pairs)
    except InvalidValueError as error:
        if not isinstance(error.value, int | np.integer):
            raise
        rule = "must not make a literal equal to its complement"
        name = sensorium.name(int(error.value))
        raise InvalidValueError("relations", rule, name) from error
    for low, sign, high in relations:
        if sign == "<" and graph.leq(high, low):
            shown = f"{sensorium.name(low)} < {sensorium.name(high)}"
            rule = "must have no cycle through a strict one"
            raise InvalidValueError("relations", rule, shown)
    return graph


def _parts(entry: RelationLike) -> list[tuple[int | str, str, int | str]]:
    """Return the relations of one entry as triples."""
    if isinstance(entry, str):
        pieces = [piece.strip() for piece in _SPLIT.split(entry)]
        if len(pieces) < 3 or not all(pieces):
            rule = "must be literals joined by <, <= or ="
            raise InvalidValueError("relation", rule, entry)
        return [
            (pieces[k], pieces[k + 1], pieces[k + 2])
            for k in range(0, len(pieces) - 2, 2)
        ]
    try:
        given: tuple[int | str, ...] = tuple(entry)
    except TypeError:
        given = ()
    if len(given) == 2:
        return [(given[0], "<=", given[1])]
    if len(given) == 3:
        return [(given[0], str(given[1]), given[2])]
    rule = "must be (a, b), (a, sign, b) or text"
    raise InvalidValueError("relation", rule, entry)
