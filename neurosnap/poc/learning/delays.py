"""Counts how long it takes from a change of one sensor until another says something.

An occasion is a tick at which a sensor comes on, or goes off; both readings are known.
What is counted of it is the *wait*: in how many ticks an *answer* comes for the first
time, 0 if at once. An answer is that another sensor is on, is off, comes on or goes
off. A wait longer than `LONGEST` is one more than that, and one that an unknown reading
or the end of the table hides is not counted.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.order.literal_sets import Words, from_words
from neurosnap.system.compiled import njit

LONGEST = 32
"""The longest wait that is told from longer ones, in ticks."""
ANSWERS = ("is on", "is off", "comes on", "goes off")
"""The answers of a sensor, in order."""
_UNKNOWN = LONGEST + 2
_MOST, _LEAST, _WORK = 4096, 256, 1 << 32
"""Occasions of a literal that are counted, evenly spread: so many at most, fewer for
the work of many sensors, and no fewer than these."""
_ONE = np.uint64(1)


class Waits(NamedTuple):
    """How long literals wait for the answers of some sensors, ``M`` in all."""

    counts: NDArray[np.int32]
    """``(2N, M, LONGEST + 2)``: how often each wait came once a literal began."""
    usual: NDArray[np.int64]
    """``(M, LONGEST + 2)``: how often each comes from any tick on."""
    each: NDArray[np.uint8]
    """``(T, M)``: the wait from each tick on; beyond `LONGEST` + 1 if not known."""


def count_waits(
    columns: Columns, sensors: slice, begun: Sequence[NDArray[np.intp]]
) -> Waits:
    """Count the waits of all literals for the answers of some sensors.

    O(T M + N M) time and space, and O(M) time for each occasion.

    Args:
        columns: The readings.
        sensors: Whose answers are awaited.
        begun: The occasions of each literal, as `occasions` returns them.
    """
    on, off = columns.on[sensors], columns.off[sensors]
    comes, goes = later(off) & on, later(on) & off
    shape = -1, on.shape[1]
    here = np.stack([on, off, comes, goes], axis=1).reshape(shape)
    rest = np.stack([off, on, (on | off) & ~comes, (on | off) & ~goes], axis=1)
    waits = np.empty((columns.ticks, len(here)), np.uint8)
    usual = np.zeros((len(here), _UNKNOWN), np.int64)
    _wait(here, rest.reshape(shape), waits, usual)
    counts = np.zeros((2 * len(columns.on), len(here), _UNKNOWN), np.int32)
    for literal, ticks in enumerate(begun):
        _count(ticks, waits, counts[literal])
    return Waits(counts, usual, waits)


def later(ticks: Words) -> Words:
    """Return sets of ticks, ``(..., W)``, each tick one later."""
    moved: Words = ticks << _ONE
    moved[..., 1:] |= ticks[..., :-1] >> np.uint64(63)
    return moved


def occasions(columns: Columns) -> list[NDArray[np.intp]]:
    """Return the ticks, from 0, at which each literal begins, as they are counted."""
    most = max(_LEAST, min(_MOST, _WORK // (8 * len(columns.on) ** 2)))
    found = []
    for literal in range(2 * len(columns.on)):
        here = columns.ticks_of(literal) & later(columns.ticks_of(literal ^ 1))
        ticks = np.flatnonzero(from_words(here, columns.ticks))
        found.append(ticks[:: -(-len(ticks) // most) or 1])
    return found


@njit()
def _wait(
    here: Words, rest: Words, waits: NDArray[np.uint8], usual: NDArray[np.int64]
) -> None:
    """Fill the waits from the last tick back, a word of all answers at a time."""
    ticks, answers = waits.shape
    longest = np.uint8(LONGEST + 1)
    ahead = np.full(answers, np.uint8(_UNKNOWN))
    without = np.zeros(answers, np.int64)
    for word in range(here.shape[1] - 1, -1, -1):
        for answer in range(answers):
            yes, no = here[answer, word], rest[answer, word]
            wait, waited = ahead[answer], without[answer]
            for tick in range(min(ticks, 64 * word + 64) - 1, 64 * word - 1, -1):
                bit = np.uint64(tick & 63)
                if yes >> bit & _ONE:
                    wait, waited = np.uint8(0), 0
                elif no >> bit & _ONE:
                    waited += 1
                    if wait < longest:
                        wait += np.uint8(1)
                    elif waited > LONGEST:
                        wait = longest
                else:
                    wait, waited = np.uint8(_UNKNOWN), 0
                waits[tick, answer] = wait
                if wait < _UNKNOWN:
                    usual[answer, wait] += 1
            ahead[answer], without[answer] = wait, waited


@njit()
def _count(
    ticks: NDArray[np.intp], waits: NDArray[np.uint8], counts: NDArray[np.int32]
) -> None:
    for tick in ticks:
        for answer in range(waits.shape[1]):
            wait = waits[tick, answer]
            if wait < _UNKNOWN:
                counts[answer, wait] += 1
