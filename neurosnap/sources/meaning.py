"""Converts a word or a number to a reading: on, off or unknown."""

import math
import re
import struct
from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import WORDS
from neurosnap.sources.conditions import (
    NUMBER,
    Change,
    Choice,
    Comparison,
    Condition,
    Heard,
    plain_unit,
)

RULE = "must be 0 or 1, false or true, off or on, or nothing for unknown"
_NUMBERS = frozenset((int, float))


class Reader:
    """Reads the values of one sensor, one after the other.

    Args:
        name: Of the sensor.
        condition: None if values are words for on and off.
        words: What words mean, in small letters.

    Attributes:
        number: That it compared last; NaN if that is unknown.
    """

    def __init__(
        self,
        name: str,
        condition: Condition | None = None,
        words: Mapping[str, bool | None] = WORDS,
    ) -> None:
        self.name = name
        self.condition = condition
        self._words = words
        self.number = math.nan
        self._before: bool | None = None
        self._said: str | float | None = None

    def read(self, value: object) -> bool | None:
        """Return what a text, or another JSON value, says; None if it is unknown.

        Raises:
            ValueError: It says nothing; the text is the rule.
        """
        condition = self.condition
        # For speed; what is no number is null as a text.
        if type(value) in _NUMBERS and value == value:
            if type(condition) is Comparison:
                return self._compare(condition, value)  # type: ignore[arg-type]
        elif type(value) is bool and condition is None and self._words is WORDS:
            return value
        text = value if isinstance(value, str) else as_text(value)
        word = text.strip().casefold()
        if condition is None:
            try:
                return self._words[word]
            except KeyError:
                raise ValueError(self._rule()) from None
        if isinstance(condition, Heard):
            return True
        if WORDS.get(word, False) is None:
            self._before = self._said = None
            self.number = math.nan
            return None
        match condition:
            case Choice():
                return word == condition.word
            case Change():
                said = word if condition.kind == "changes" else _number(word)
                before, self._said = self._said, said
                return None if before is None else condition.is_on(said, before)
        if condition.unit:
            word = plain_unit(text).strip().removesuffix(condition.unit).rstrip()
        return self._compare(condition, _number(word, condition.unit))

    def _compare(self, condition: Comparison, number: float) -> bool | None:
        self.number, self._before = number, condition.is_on(number, self._before)
        return self._before

    def _rule(self) -> str:
        """Return what a word must be."""
        if self._words is WORDS:
            return RULE
        known = [word for word, on in self._words.items() if on is not None]
        return f"must be one of {', '.join(known)}"


def readers_of(name: str, some: Iterable[Condition | None]) -> list[Reader]:
    """Return what reads a signal: one for each condition, as in `Signals`."""
    return [Reader(each.name if each else name, each) for each in some]


def _number(word: str, unit: str = "") -> float:
    """Return a number.

    Raises:
        ValueError: It is none.
    """
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if math.isnan(number):
        what = f"a number, or one in {unit}" if unit else "a number"
        raise ValueError(f"must be {what}, or nothing for unknown")
    return number


def compared(conditions: Iterable[Condition | None]) -> dict[int, int]:
    """Return of the sensors that compare a number which of the numbers that is.

    Args:
        conditions: When each sensor is on, in order.
    """
    places: dict[str, int] = {}
    return {
        sensor: places.setdefault(condition.source, len(places))
        for sensor, condition in enumerate(conditions)
        if isinstance(condition, Comparison)
    }


class Numbers:
    """The numbers that signals said last, packed as in `wire.Observation`.

    Args:
        readers: Of all sensors, in order.
    """

    def __init__(self, readers: Sequence[Reader] = ()) -> None:
        places = compared(reader.condition for reader in readers)
        first = {place: sensor for sensor, place in reversed(places.items())}
        self._each = [(first[place], readers[first[place]]) for place in sorted(first)]

    def packed(self, known: NDArray[np.bool_] | None) -> bytes:
        """Return them; ``(N,)`` tells which sensors are known, None that all are."""
        if not self._each:
            return b""
        said = [
            reader.number if known is None or known[sensor] else math.nan
            for sensor, reader in self._each
        ]
        with np.errstate(over="ignore"):  # what is too large is infinite, and not told
            return np.array(said, "<f4").tobytes()


def numbers_in(said: bytes, places: Mapping[int, int]) -> dict[int, float]:
    """Return the known numbers of an observation, by the sensors that compare them.

    Args:
        said: As `Numbers` packs them; others of a stranger's recording are left out.
        places: As `compared` returns them.
    """
    numbers = [number for (number,) in struct.iter_unpack("<f", said[: len(said) & ~3])]
    return {
        sensor: float(f"{numbers[place]:.6g}")  # float32 has no more
        for sensor, place in places.items()
        if place < len(numbers) and math.isfinite(numbers[place])
    }


def refused(where: str, name: str, error: ValueError, text: str) -> InvalidValueError:
    """Return the error of a value in data; a number is one that was not asked for.

    Args:
        where: Where the value stands.
        name: Of its sensor.
        error: From `Reader.read`.
        text: The value.
    """
    rule = str(error)
    if rule == RULE and is_number(text):
        rule += f' (or --when "{name} > NUMBER"; for a run, --set when=...)'
    return InvalidValueError(f"{where}: {name}", rule, text)


def is_number(text: str) -> bool:
    """Return whether a text is a number."""
    return re.fullmatch(NUMBER, text.strip(), re.ASCII) is not None


def as_text(value: object) -> str:
    """Return a JSON value as the text it would be if it stood alone.

    Examples:
        >>> as_text(True), as_text(1.0), as_text(None)
        ('true', '1', 'null')
    """
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if type(value) is int:
        return str(value)  # of any size, which JSON is not
    return msgspec.json.encode(value).decode()
