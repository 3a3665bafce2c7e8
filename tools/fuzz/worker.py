"""The worker under hostile input: whole arrays in one field, and numbers inside them.

A field that packs numbers gets past the decoder whatever is in it, so here they are
altered one by one as well, and moved past each other.

Compiled loops do not look where they index. With ``NUMBA_BOUNDSCHECK=1`` they do, and
``NUMBA_CACHE_DIR`` then has to name a folder of its own.
"""

import random
import struct

import msgspec

from neurosnap import wire
from neurosnap.protocol.partition import shares
from neurosnap.protocol.wave import DEEPEST
from neurosnap.protocol.worker import Worker
from tools.fuzz.messages import altered, number
from tools.fuzz.run import SENSORS, Honest
from tools.fuzz.targets import Count, Twins

WORKERS = 2
"""Workers of the run, which share its cells."""
_INSIDE = (-(2**31), DEEPEST, DEEPEST + 1, 2**31 - 1)


class WorkerTarget:
    """A worker, among what it heard in a run where workers shared the learning, too."""

    def __init__(self, honest: Honest) -> None:
        self._options = honest.options
        self._scripts = [
            honest.heard_by((*wire.worker_keys(worker), *wire.LEARNING_KEYS))
            for worker in range(WORKERS)
        ]

    def round(self, chance: random.Random, count: Count) -> None:
        """Take one worker through the run."""
        worker = chance.randrange(WORKERS)
        learning = self._options.new_worker_learning(worker)
        core = Worker(worker, shares(SENSORS, WORKERS), learning)
        script = self._scripts[worker]
        # A burst ahead of its wave is not looked at more closely until that begins.
        twins = Twins(core, script, lambda m: [m], repacked, after=len(script))
        twins.play(chance, count, 16)


def repacked(message: wire.Message, chance: random.Random) -> wire.Message:
    """Return `message` with something altered, more often than not in an array."""
    packed = [
        name
        for name in message.__struct_fields__
        if isinstance(getattr(message, name), bytes)
    ]
    if not packed or chance.random() < 0.3:
        return altered(message, chance)
    # Columns of the same length get past more checks than one that is longer.
    chosen = packed if chance.random() < 0.3 else [chance.choice(packed)]
    length = chance.choice((0, 1, 2, 3, 8, 300))
    changes = {
        name: _grown(getattr(message, name), length, chance)
        if chosen is packed
        else _altered(getattr(message, name), chance)
        for name in chosen
    }
    return msgspec.structs.replace(message, **changes)


def _grown(data: bytes, length: int, chance: random.Random) -> bytes:
    """Return as many of a field's numbers as wanted, in any order."""
    numbers = _numbers(data) or [number(chance, 0)]
    return _packed(chance.choices(numbers, k=length))


def _altered(data: bytes, chance: random.Random) -> bytes:
    """Return a field with numbers altered, moved, taken out, or cut through."""
    numbers = _numbers(data)
    place = chance.randrange(max(len(numbers), 1))
    kind = chance.random()
    if kind < 0.6:
        numbers[place : place + 1] = [_inside(chance)]
    elif kind < 0.7:
        numbers.insert(place, _inside(chance))
    elif kind < 0.8:
        del numbers[place : place + 1]
    elif kind < 0.9:
        chance.shuffle(numbers)
    else:
        return data[: chance.randrange(len(data) + 1)] + bytes(chance.randrange(4))
    return _packed(numbers)


def _inside(chance: random.Random) -> int:
    """Draw a number that a packed field can hold."""
    kind = chance.random()
    if kind < 0.6:  # a literal of some worker, or just beyond all
        return chance.randrange(-1, 2 * SENSORS + 2)
    return chance.choice(_INSIDE) if kind < 0.8 else number(chance, 0)


def _numbers(data: bytes) -> list[int]:
    return list(wire.numbers("field", data[: len(data) // 4 * 4]))


def _packed(numbers: list[int]) -> bytes:
    return struct.pack(f"<{len(numbers)}i", *numbers)
