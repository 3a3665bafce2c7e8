"""Sensor names, literals and packed observations.

Sensor ``s`` has the literals ``2s`` (itself) and ``2s + 1`` (its complement, written
with a star); the complement of literal ``a`` is ``a ^ 1``. An observation is one bit a
sensor, which is the same thing as a complete *-selection of literals.
"""

import operator
import unicodedata
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError, UnknownSensorError, similar

# Line and paragraph separators break a line like control characters do; surrogates
# cannot be written to a file.
_UNPRINTABLE = frozenset({"Cc", "Cs", "Zl", "Zp"})


# Of the letters that show nothing themselves, those that words need: Persian and Indic
# ones, and some emoji.
_JOINERS = "\u200c\u200d"


def visible(text: str) -> str:
    r"""Return `text` with an escape for each letter that hides or turns what is shown.

    Examples:
        >>> visible("door\u202eno")
        'door\\u202eno'
    """
    return "".join(
        letter
        if letter in _JOINERS or unicodedata.category(letter) != "Cf"
        else letter.encode("ascii", "backslashreplace").decode()
        for letter in text
    )


ON = ("on", "true", "1", "yes", "open", "opened", "detected", "home", "online")
OFF = ("off", "false", "0", "no", "closed", "clear", "not_home", "offline")
UNKNOWN = ("", "none", "null", "unknown", "unavailable")
"""Words that say that nothing is known, for every sensor; an empty payload is one."""

WORDS: dict[str, bool | None] = {
    **dict.fromkeys((*UNKNOWN, "na", "nan", "<na>", "n/a")),
    **dict.fromkeys((*ON, "1.0"), True),
    **dict.fromkeys((*OFF, "0.0"), False),
}
"""What words mean, in small letters. Pandas writes 1.0 where a column has gaps."""


class Sensorium:
    """The names of the sensors, in order; immutable.

    Args:
        names: One name a sensor. Each is unique, not empty, has no control characters
            and no white space at its ends, and does not end with ``*``, which marks
            complements.

    Raises:
        InvalidValueError: A name breaks a rule.

    Examples:
        >>> s = Sensorium(["door", "motion"])
        >>> s.literal("door*"), s.name(1), len(s)
        (1, 'door*', 2)
    """

    __slots__ = ("_index", "_names")

    def __init__(self, names: Iterable[str]) -> None:
        if isinstance(names, str):
            raise InvalidValueError("names", "must be several, not one string", names)
        self._names: tuple[str, ...] = tuple(_checked(name) for name in names)
        self._index: dict[str, int] = {}
        for sensor, name in enumerate(self._names):
            if self._index.setdefault(name, sensor) != sensor:
                raise InvalidValueError("names", "must be unique", name)

    @classmethod
    def of(cls, count: int) -> "Sensorium":
        """Return `count` sensors named ``s0``, ``s1``, and so on.

        Raises:
            InvalidValueError: `count` is no whole number from 0 up.

        Examples:
            >>> Sensorium.of(3).names
            ('s0', 's1', 's2')
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer):
            raise InvalidValueError("sensors", "must be a whole number", count)
        if count < 0:
            raise InvalidValueError("sensors", "must be 0 or more", count)
        return cls(f"s{sensor}" for sensor in range(count))

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in order."""
        return self._names

    def literal(self, name: str) -> int:
        """Return the literal called `name`, with a ``*`` at its end for a complement.

        Raises:
            UnknownSensorError: No sensor has that name.
        """
        if isinstance(name, str):
            starred = name.endswith("*")
            sensor = self._index.get(name[:-1] if starred else name)
            if sensor is not None:
                return 2 * sensor + starred
        rule = f"must name a sensor that exists{similar(name, self._names)}"
        raise UnknownSensorError("literal", rule, name)

    def name(self, literal: int) -> str:
        """Return the name of `literal`, with a ``*`` at its end for a complement.

        Raises:
            UnknownSensorError: `literal` is no whole number from 0 to ``2N - 1``.
        """
        try:
            number = operator.index(literal)
        except TypeError:
            number = -1
        if not 0 <= number < 2 * len(self._names):
            rule = f"must be a whole number in [0, {2 * len(self._names)})"
            raise UnknownSensorError("literal", rule, literal)
        return self._names[number >> 1] + "*" * (number & 1)

    def observation(self, bits: ArrayLike) -> NDArray[np.bool_]:
        """Return `bits`, bool or numbers, as an observation: ``(N,)`` bool.

        Returns:
            The same array if it already is one, a new one otherwise.

        Raises:
            ShapeError: It does not hold one bit a sensor.
            InvalidValueError: An entry is not 0 or 1.

        Examples:
            >>> Sensorium(["door", "motion"]).observation([1, 0])
            array([ True, False])
        """
        array = _as_bits("observation", bits)
        if array.shape != (len(self._names),):
            rule = f"must hold {len(self._names)} bits, one a sensor"
            raise ShapeError("observation", rule, array.shape)
        return array

    def __len__(self) -> int:
        return len(self._names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sensorium):
            return NotImplemented
        return self._names == other._names

    def __hash__(self) -> int:
        return hash(self._names)

    def __repr__(self) -> str:
        return f"Sensorium({list(self._names)!r})"


def pack(bits: ArrayLike) -> bytes:
    r"""Return `bits` eight to a byte, the lowest bit first, the rest filled with 0.

    Raises:
        ShapeError: It has more than one axis.
        InvalidValueError: An entry is not 0 or 1.

    Examples:
        >>> pack([1, 0, 0, 1])
        b'\t'
    """
    array = _as_bits("bits", bits)
    if array.ndim != 1:
        raise ShapeError("bits", "must have one axis", array.shape)
    return np.packbits(array, bitorder="little").tobytes()


def unpack(data: bytes, count: int) -> NDArray[np.bool_]:
    r"""Return the `count` bits that `pack` made `data` of: ``(count,)`` bool.

    Raises:
        ShapeError: `data` has another length than `count` bits take, or bits beyond
            them.
        InvalidValueError: `count` is negative.

    Examples:
        >>> unpack(b"\t", 4)
        array([ True, False, False,  True])
    """
    if count < 0:
        raise InvalidValueError("count", "must be 0 or more", count)
    if len(data) != (count + 7) // 8:
        rule = f"must be {(count + 7) // 8} bytes long for {count} bits"
        raise ShapeError("packed bits", rule, len(data))
    flat = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
    if flat[count:].any():
        rule = f"must be 0 beyond the first {count} bits"
        raise ShapeError("packed bits", rule, bytes(data))
    return flat[:count].astype(np.bool_)


def unpack_readings(
    bits: bytes, known: bytes, count: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_] | None]:
    """Return what `count` sensors read, and which is known, None if all: ``(N,)`` each.

    Both as `pack` made them; `known` is empty if all are.

    Raises:
        ShapeError: They are of another number of sensors.
    """
    return unpack(bits, count), unpack(known, count) if known else None


def complement(literals: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the complements of a set of literals: ``(2N,)`` bool, a new array.

    Raises:
        ShapeError: It does not hold two literals a sensor.

    Examples:
        >>> complement(np.array([True, False, False, False]))
        array([False,  True, False, False])
    """
    if literals.ndim != 1 or len(literals) % 2:
        raise ShapeError("literals", "must be (2N,)", literals.shape)
    return literals.reshape(-1, 2)[:, ::-1].reshape(-1)


def complete(bits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the complete *-selection of an observation: one literal a sensor.

    It is ``(2N,)`` bool, a new array; `Sensorium.observation` gives an observation.

    Raises:
        ShapeError: It has more than one axis.

    Examples:
        >>> complete(np.array([True, False]))
        array([ True, False, False,  True])
    """
    if bits.ndim != 1:
        raise ShapeError("observation", "must be (N,)", bits.shape)
    literals = np.empty(2 * len(bits), np.bool_)
    literals[::2] = bits
    np.logical_not(bits, out=literals[1::2])
    return literals


def selection(
    bits: NDArray[np.bool_], known: NDArray[np.bool_] | None
) -> NDArray[np.bool_]:
    """Return the literals observed, one of each sensor whose reading is known.

    It is a *-selection, ``(2N,)`` ([GK] "Observation Model for DBAs"), complete where
    all are known.
    """
    literals = complete(bits)
    return literals if known is None else literals & np.repeat(known, 2)


def as_known(known: ArrayLike, count: int) -> NDArray[np.bool_]:
    """Return which of `count` readings are known: ``(count,)`` bool.

    Raises:
        ShapeError: There is not one flag a reading.
        InvalidValueError: They are not bool: numbers are likely to be readings.

    Examples:
        >>> as_known([True, False], 2)
        array([ True, False])
    """
    mask = np.asarray(known)
    if mask.shape != (count,):
        raise ShapeError("known", f"must hold {count} flags, one a sensor", mask.shape)
    if mask.dtype != np.bool_ and mask.size:
        raise InvalidValueError("known", "must be bool", mask.dtype)
    return mask.astype(np.bool_, copy=False)


def _checked(name: object) -> str:
    """Return `name` if it may name a sensor."""
    if not isinstance(name, str):
        raise InvalidValueError("sensor name", "must be text", name)
    if not name:
        raise InvalidValueError("sensor name", "must not be empty", name)
    if name.endswith("*"):
        raise InvalidValueError("sensor name", "must not end with *", name)
    if name != name.strip():
        raise InvalidValueError("sensor name", "must have no space at its ends", name)
    # Of most names that is known at once.
    if not name.isprintable() and any(
        unicodedata.category(letter) in _UNPRINTABLE for letter in name
    ):
        raise InvalidValueError("sensor name", "must have no control characters", name)
    return name


def _as_bits(name: str, bits: ArrayLike) -> NDArray[np.bool_]:
    """Return `bits` as a bool array; the same one if it is that already."""
    if isinstance(bits, np.ndarray) and bits.dtype == np.bool_:
        return bits
    try:
        array: NDArray[Any] = np.asarray(bits)
    except ValueError as error:
        raise InvalidValueError(name, "must be a flat list of bits", bits) from error
    if array.size and array.dtype.kind not in "biuf":
        raise InvalidValueError(name, "must be made of bits, 0 or 1", bits)
    on = array == 1
    wrong = ~(on | (array == 0))
    if wrong.any():
        place = tuple(int(k) for k in np.argwhere(wrong)[0])
        rule = f"must be 0 or 1 (at {', '.join(map(str, place))})"
        raise InvalidValueError(name, rule, array[place].item())
    return np.asarray(on, np.bool_)
