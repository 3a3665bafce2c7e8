"""Decides from the four weights of two sensors which of them implies the other.

`code_of` is the one derivation of a code: all kernels of learning compile it into their
loops. A cell, whose process loads neither numpy nor numba, runs it as plain Python:
each operation on floats is done in the same order in both, so that the results are the
same bits.

**The codes are frozen.** They are sent to the workers and the recorder, stand in
key-frames and are compared bit for bit by a replay.
"""

from collections.abc import Callable
from typing import Any, Final, TypeAlias, TypeVar

Code = TypeVar("Code")
Weight: TypeAlias = Any
"""A float or a whole number of 32 bits. The type of the latter is numpy's, which is not
imported here."""

SLACK = 1e-12
"""By how much a discounted weight must be smaller to count as smaller."""
TINY = 1e-300
"""Halving goes on below the least normal number, where arithmetic is a hundred times
slower; what is as small as this is 0 to every comparison already."""
AUTO: Final = "auto"
"""Given instead of a threshold: each pair chooses its own."""
LENGTH = 8192
"""Ticks that a history keeps unless told otherwise: 2 kB a sensor."""


def code_of(
    w11: Weight,
    w10: Weight,
    w01: Weight,
    w00: Weight,
    limit: Weight,
    slack: float | None,
    kind: Callable[[int], Code],
) -> tuple[Code, bool, bool]:
    """Return the code of a pair ([GK] eqn:virtual implication).

    ``a -> b`` iff ``w_ab* < min(limit, w_ab, w_a*b, w_a*b*)``, and ``a <-> b`` iff
    ``w_ab* = w_a*b = 0``. It has no branch, so that a loop over pairs becomes vector
    instructions.

    Args:
        w11: The weight of both on: ``w_ij``; whole numbers of 32 bits, or floats.
        w10: ``w_ij*``.
        w01: ``w_i*j``.
        w00: ``w_i*j*``.
        limit: What the weight against an implication must be less than.
        slack: By how much a float must be smaller to count as smaller, and above what
            it is not 0; None for whole numbers, which are compared exactly.
        kind: What a code is made with: `int`; in a loop numpy's `uint8`, for wider
            whole numbers cost it a tenth of its speed.

    Returns:
        The code, see `neurosnap.poc.learning.pairs`; whether it is an implication
        (and no equivalence) with the lesser of ``w_ij*`` and ``w_i*j`` against it; and
        whether one with the lesser of ``w_ij`` and ``w_i*j*`` against it.
    """
    mixed, like = min(w10, w01), min(w11, w00)
    more, most = max(w10, w01), max(w11, w00)
    if slack is None:
        equal, opposite = more == 0, most == 0
        up = (mixed < min(more, like)) & (mixed < limit)
        down = (like < min(most, mixed)) & (like < limit)
    else:
        # Rounding may take a weight below 0; an equivalence excludes the rest all the
        # same.
        equal, opposite = more <= slack, most <= slack
        loose = not (equal | opposite)
        up = loose & (mixed < min(min(more, like), limit) - slack)
        down = loose & (like < min(min(most, mixed), limit) - slack)
    code = kind(0)
    code = (kind(1) if w10 < w01 else kind(2)) if up else code
    code = (kind(4) if w11 < w00 else kind(8)) if down else code
    code = kind(3) if equal else code
    return (kind(12) if opposite else code), up, down


def weighed(
    mine: tuple[int, int],
    theirs: tuple[int, int],
    ticks: range,
    length: int,
    decay: float,
    share: float,
) -> tuple[tuple[float, float, float, float], int]:
    """Return what a history makes of a newborn sensor's weights with another.

    Args:
        mine: The rings of the newborn: the ticks at which it would have read on, and
            those at which it would have read off, as bits.
        theirs: Those of the other.
        ticks: The ticks of the history, counted from 0; tick ``t`` is bit ``t %
            length``.
        length: Of the rings.
        decay: What is kept of a weight each time.
        share: The threshold.

    Returns:
        The weights ``w_ij, w_ij*, w_i*j, w_i*j*``, and the code of what follows from
        them; see `neurosnap.poc.learning.pairs`. O(ticks) time.
    """
    w11 = w10 = w01 = w00 = 0.25
    code, gain = 0, 1.0 - decay
    # Digits are found faster than bits.
    on, off, theirs_on, theirs_off = (
        f"{ring:0{length}b}"[::-1] for ring in (*mine, *theirs)
    )
    for tick in ticks:
        place = tick % length
        known = theirs_on[place] == "1" or theirs_off[place] == "1"
        bit = on[place] == "1"
        if not known or not (bit or off[place] == "1"):
            continue
        other = theirs_on[place] == "1"
        w11 = _faded(w11, decay, gain if bit and other else 0.0)
        w10 = _faded(w10, decay, gain if bit and not other else 0.0)
        w01 = _faded(w01, decay, gain if not bit and other else 0.0)
        w00 = _faded(w00, decay, gain if not bit and not other else 0.0)
        code, up, down = code_of(w11, w10, w01, w00, share, SLACK, int)
        shift = min(w10, w01) if up else (-min(w11, w00) if down else 0.0)
        w11, w00 = w11 + shift, w00 + shift
        w10, w01 = w10 - shift, w01 - shift
    return (w11, w10, w01, w00), code


def _faded(weight: float, decay: float, gain: float) -> float:
    """Keep a share of a weight and add what is gained; the least becomes 0."""
    faded = decay * weight + gain
    return faded if faded > TINY else 0.0
