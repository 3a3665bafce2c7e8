"""Validated sets of literals, as bool arrays, packed words or whole numbers.

A set is a bool array with a place a literal. Packed, it is a row of 64-bit words, the
lowest bit first, zero beyond the last literal: literal ``a`` is bit ``a % 64`` of word
``a // 64``. A sensor's two literals always share a word. As a *mask* it is a Python
int, of which bit ``a`` is literal ``a``: fast where one set is in hand at a time.
"""

import operator
from collections.abc import Iterable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError

_LONG = 256  # bits of a mask from which on an array of them is quicker
Literals: TypeAlias = NDArray[np.bool_] | Iterable[int]
"""What may be given for a set of literals: ``(2N,)`` bool, or the literals."""
Words: TypeAlias = NDArray[np.uint64]
"""Packed sets: the last axis holds one set's words."""


def as_literals(name: str, literals: Literals, total: int) -> NDArray[np.bool_]:
    """Return a set of literals as a new bool array.

    Args:
        name: What to call it in an error.
        literals: ``(total,)`` bool, or the literals as whole numbers.
        total: How many literals there are, ``2N``.

    Returns:
        ``(total,)`` bool, C-contiguous, not shared with the argument.

    Raises:
        ShapeError: A bool array of another shape.
        InvalidValueError: An entry is no literal.
    """
    if isinstance(literals, np.ndarray) and literals.dtype == np.bool_:
        if literals.shape != (total,):
            raise ShapeError(name, f"must be ({total},)", literals.shape)
        return literals.copy()
    chosen = np.zeros(total, np.bool_)
    try:
        given = iter(literals)
    except TypeError as error:
        rule = f"must be ({total},) bool or the literals"
        raise InvalidValueError(name, rule, literals) from error
    for literal in given:
        # A call for each would be most of the time that a small wave takes.
        if type(literal) is not int or not 0 <= literal < total:
            literal = as_literal(name, literal, total)
        chosen[literal] = True
    return chosen


def as_literal(name: str, literal: object, total: int) -> int:
    """Return one literal as an int.

    Raises:
        InvalidValueError: It is no whole number in ``[0, total)``; a bool is none.
    """
    number = -1
    if not isinstance(literal, bool | np.bool_):
        try:
            number = operator.index(literal)  # type: ignore[arg-type]
        except TypeError:
            number = -1
    if not 0 <= number < total:
        rule = f"must be a literal, a whole number in [0, {total})"
        raise InvalidValueError(name, rule, literal)
    return number


def to_words(sets: NDArray[np.bool_]) -> Words:
    """Return sets packed: ``(..., n)`` bool to ``(..., ceil(n / 64))`` words."""
    packed = np.packbits(sets, axis=-1, bitorder="little")
    words = np.zeros((*sets.shape[:-1], (sets.shape[-1] + 63) // 64), "<u8")
    words.view(np.uint8)[..., : packed.shape[-1]] = packed
    return words


def from_words(words: Words, total: int) -> NDArray[np.bool_]:
    """Return packed sets as bool: ``(..., w)`` words to ``(..., total)``."""
    octets = np.ascontiguousarray(words).view(np.uint8)
    # A last axis of length 0 keeps `count` from meaning anything to numpy.
    if not total:
        return np.zeros((*words.shape[:-1], 0), np.bool_)
    bits = np.unpackbits(octets, axis=-1, count=total, bitorder="little")
    return bits.view(np.bool_)


def to_mask(literals: NDArray[np.bool_]) -> int:
    """Return a set of literals, ``(n,)`` bool, as a number.

    Examples:
        >>> to_mask(np.array([True, False, True]))
        5
    """
    return int.from_bytes(np.packbits(literals, bitorder="little").tobytes(), "little")


def from_mask(mask: int, total: int) -> NDArray[np.bool_]:
    """Return a number as a set of literals: ``(total,)`` bool, a new array.

    Examples:
        >>> from_mask(5, 4)
        array([ True, False,  True, False])
    """
    if not total:
        return np.zeros(0, np.bool_)
    octets = np.frombuffer(mask.to_bytes((total + 7) // 8, "little"), np.uint8)
    return np.unpackbits(octets, count=total, bitorder="little").view(np.bool_)


def positive(total: int) -> int:
    """Return the literals that are no complements, of `total`: bits 0, 2, 4, and on.

    Examples:
        >>> positive(6)
        21
    """
    return ((1 << total + total % 2) - 1) // 3


def starred(mask: int, even: int) -> int:
    """Return the complements of a set: neighbouring bits change places.

    `even` is `positive` of the number of literals.

    Examples:
        >>> starred(0b0110, positive(4))
        9
    """
    return (mask & even) << 1 | (mask >> 1) & even


def members(mask: int) -> Iterator[int]:
    """Yield the literals of a set, the lowest first.

    Examples:
        >>> list(members(0b1010))
        [1, 3]
    """
    if mask.bit_length() > _LONG:
        yield from np.flatnonzero(from_mask(mask, mask.bit_length())).tolist()
        return
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
