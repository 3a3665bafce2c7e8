"""Random and altered messages whose fields keep their types.

Fields and their types are read off the messages themselves, so a new message needs no
word here; a new type of field is refused until it has a way to be drawn.
"""

import random
import struct
from typing import Any

import msgspec
from msgspec import inspect

from neurosnap import wire
from neurosnap.protocol.cell_and_worker_base import DEEPEST

_TYPES = {
    kind.cls: kind
    for kind in inspect.multi_type_info(wire.TOPICS.values())
    if isinstance(kind, inspect.StructType)
}
_EDGES = (0, 1, 2, 4095, 4097, 8193, DEEPEST, DEEPEST + 1, 2**20, 2**31 - 2, 2**31 - 1)


def number(chance: random.Random, lowest: int) -> int:
    """Draw a number: mostly a small one, else one at the edge of something."""
    kind = chance.random()
    if kind < 0.6:
        return max(lowest, chance.randrange(12))
    if kind < 0.9:
        return max(lowest, chance.choice(_EDGES))
    return max(lowest, chance.getrandbits(chance.randrange(1, 32)))


def value(kind: inspect.Type, chance: random.Random) -> Any:  # noqa: ANN401
    """Draw a value that a field of this type may hold."""
    match kind:
        case inspect.IntType():
            drawn_number = number(chance, -1 if kind.ge is None else kind.ge)
            return drawn_number if kind.le is None else min(drawn_number, kind.le)
        case inspect.BoolType():
            return chance.random() < 0.5
        case inspect.FloatType():
            return chance.choice((0.0, -0.5, 1e300, chance.random()))
        case inspect.BytesType():
            return chance.randbytes(chance.choice((0, 1, 1, 1, 2, 3, 40)))
        case inspect.MemoryViewType():
            return memoryview(chance.randbytes(chance.choice((0, 1, 4, 8, 40))))
        case inspect.StrType():
            return chance.choice(("", "cell/1", "world", "x" * 300, "\U0001f9e0\0é"))
        case inspect.LiteralType():
            return chance.choice(kind.values)
        case inspect.StructType():
            fields = {field.name: value(field.type, chance) for field in kind.fields}
            return kind.cls(**fields)
        case inspect.VarTupleType():
            length = chance.choice((0, 0, 1, 1, 2, 3, 9, 60))
            return tuple(value(kind.item_type, chance) for _ in range(length))
        case _:
            raise NotImplementedError(f"no values are drawn of {kind}")


def message(chance: random.Random) -> wire.Message:
    """Draw any valid message."""
    drawn: wire.Message = value(chance.choice([*_TYPES.values()]), chance)
    return drawn


def altered(message: wire.Message, chance: random.Random) -> wire.Message:
    """Return `message` with a field or two drawn anew.

    An observation often becomes a partial one, or nearly: drawn each by itself, its
    fields would hardly ever fit each other. A field that packs numbers gets past the
    decoder whatever is in it, so there they are altered one by one as well.
    """
    if isinstance(message, wire.Observation) and chance.random() < 0.5:
        known = chance.randbytes(len(message.bits))
        masked = bytes(a & b for a, b in zip(message.bits, known, strict=True))
        bits = message.bits if chance.random() < 0.3 else masked
        return msgspec.structs.replace(message, bits=bits, known=known)
    fields = _TYPES[type(message)].fields
    packs = inspect.BytesType | inspect.MemoryViewType
    packed = [field.name for field in fields if isinstance(field.type, packs)]
    if packed and chance.random() < 0.6:
        name = chance.choice(packed)
        data = _repacked(getattr(message, name), chance)
        return msgspec.structs.replace(message, **{name: data})
    chosen = chance.sample(fields, min(len(fields), chance.choice((1, 1, 2))))
    changes = {field.name: value(field.type, chance) for field in chosen}
    return msgspec.structs.replace(message, **changes)


def _repacked(data: bytes | memoryview, chance: random.Random) -> bytes:
    """Return packed numbers with one altered, added or gone, in any order, or cut."""
    whole = bytes(data)
    numbers = [*struct.unpack(f"<{len(whole) // 4}i", whole[: len(whole) // 4 * 4])]
    place = chance.randrange(len(numbers) + 1)
    drawn = chance.choice((chance.randrange(-1, 12), -(2**31), number(chance, 0)))
    match chance.randrange(6):
        case 0 | 1:
            numbers[place : place + 1] = [drawn]
        case 2:
            numbers.insert(place, drawn)
        case 3:
            del numbers[place : place + 1]
        case 4:
            # Columns of the same length get past more checks than one that is longer.
            length = chance.choice((0, 1, 2, 3, 8, 300))
            numbers = chance.choices(numbers or [drawn], k=length)
        case _:
            return whole[: chance.randrange(len(whole) + 1)] + bytes(place % 4)
    return struct.pack(f"<{len(numbers)}i", *numbers)
