"""Keeps the last readings of a part's sensors, and answers questions about them.

A cell has no history until it is asked for one: then it says that it lacks it, is
reminded, and keeps it up from there with its own readings. A part that has missed a
reading has none again. So a history is always whole up to its last tick.

Cell processes import this module: it needs neither numpy nor numba.
"""

import struct
from collections.abc import Iterable
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

from neurosnap import wire
from neurosnap.errors import MessageError


class PartHistory:
    """The histories of a part's cells, kept for the cells that were asked for them."""

    def __init__(self, who: str, cells: range) -> None:
        self._who = who
        self._cells = cells
        self._tick = 0  # the last in it; 0: there is none
        self._length = 0
        self._rings: dict[int, int] = {}  # by literal: bits of the ticks it was read at

    def observe(self, tick: int, literals: Iterable[int]) -> None:
        """Add what was read at a tick. O(length) bits are copied for each cell.

        Of a cell whose reading is unknown neither literal is among those read.
        """
        if tick <= self._tick or not self._tick:
            return
        if tick > self._tick + 1:
            self._tick, self._rings = 0, {}
            return
        bit, read = 1 << (tick - 1) % self._length, set(literals)
        for literal, ring in self._rings.items():
            others = ring & ~bit
            self._rings[literal] = others | bit if literal in read else others
        self._tick = tick

    def remember(self, reminder: wire.Reminder) -> None:
        """Take over the coordinator's histories; MessageError if they are not right."""
        found = check_reminder(reminder, self._who, self._cells)
        if reminder.tick < self._tick:
            return
        here = reminder.tick, reminder.length
        if here != (self._tick, self._length):
            (self._tick, self._length), self._rings = here, {}
        for cell, *both in found:
            for literal, ring in zip((2 * cell, 2 * cell + 1), both, strict=True):
                self._rings[literal] = int.from_bytes(ring, "little")

    def answer(self, recall: wire.Recall) -> list[wire.Message]:
        """Answer a question, if any cell is asked; MessageError if it is not right."""
        counted = check_recall(recall)
        own = range(2 * self._cells.start, 2 * self._cells.stop)
        readings = [a for a in recall.readings if a in own]
        asked = [[a for a in count.literals if a in own] for count in counted]
        several = {a >> 1 for a in chain(readings, *asked)}
        if recall.tick < self._tick or not several:
            return []
        here, rings = (self._who, recall.tick, recall.round), self._rings
        late = recall.tick > self._tick
        lacks = sorted(cell for cell in several if late or 2 * cell not in rings)
        if lacks:
            return [wire.Recalled(*here, lacks=tuple(lacks))]
        counts = []
        for literals, count in zip(asked, counted, strict=True):
            within = int.from_bytes(count.within, "little")
            counts += [(rings[a] & within).bit_count() for a in literals]
        packed = [
            rings[a].to_bytes((rings[a].bit_length() + 7) // 8, "little")
            for a in readings
        ]
        return [
            wire.Recalled(
                *here,
                readings=wire.joined_rings(packed),
                counts=struct.pack(f"<{len(counts)}i", *counts),
            )
        ]


class Counted(NamedTuple):
    """One of the counts that a question asks for."""

    within: bytes
    """The ticks, as a ring of bits."""
    literals: tuple[int, ...]
    """How often was each read at these?"""


def check_recall(recall: wire.Recall) -> list[Counted]:
    """Return the counts a question asks for; MessageError: it contradicts itself."""
    literals = wire.numbers("recall: counted", recall.counted)
    if sum(recall.sizes) != len(literals):
        rule = f"must be of {sum(recall.sizes)} literals"
        raise MessageError(f"recall: counted: {rule}, got {len(literals)}")
    rings = wire.split_rings("recall: within", recall.within, len(recall.sizes))
    check_rings("recall", rings, wire.HISTORY_OF_ACTIONS)
    ends = list(accumulate(recall.sizes, initial=0))
    return [
        Counted(ring, literals[first:last])
        for ring, (first, last) in zip(rings, pairwise(ends), strict=True)
    ]


def check_reminder(
    reminder: wire.Reminder, who: str, cells: range
) -> list[tuple[int, bytes, bytes]]:
    """Raise MessageError if a history contradicts itself, or is of another's cells.

    Returns:
        Each cell, and its rings: the ticks at which it read on, and off.
    """
    length, count = reminder.length, len(reminder.cells)
    if reminder.to != who:
        raise MessageError(f"reminder: must be for {who}, got {reminder.to:.40}")
    if length % 64 or length > wire.HISTORY_OF_ACTIONS:
        rule = f"must keep a multiple of 64 ticks, up to {wire.HISTORY_OF_ACTIONS}"
        raise MessageError(f"reminder: {rule}, got {length}")
    several = set(reminder.cells)
    if not several <= set(cells) or not 0 < len(several) == count:
        got = ", ".join(map(str, reminder.cells[:10])) or "none"
        rule = f"must be of cells of {who}, each once"
        raise MessageError(f"reminder: {rule}, got {got}")
    on = wire.split_rings("reminder: on", reminder.on, count)
    off = wire.split_rings("reminder: off", reminder.off, count)
    check_rings("reminder", (*on, *off), length)
    found = list(zip(reminder.cells, on, off, strict=True))
    for cell, *both in found:
        reads_on, reads_off = (int.from_bytes(ring, "little") for ring in both)
        if reads_on & reads_off:
            rule = f"must have sensor {cell} on or off at a tick"
            raise MessageError(f"reminder: {rule}, got both")
    return found


def check_rings(name: str, rings: Iterable[bytes], length: int) -> None:
    """Raise MessageError for bits beyond the length of a ring."""
    longest = max(map(len, rings), default=0)
    if longest > length // 8:
        rule = f"must have up to {length} bits a ring"
        raise MessageError(f"{name}: {rule}, got {8 * longest}")
