"""Makes readings of what the signals of a live source say.

The sensors of a run are fixed before its first tick, and so is how each is read.
"""

import threading
from collections.abc import Mapping, Sequence
from typing import Protocol

from neurosnap.errors import InvalidValueError
from neurosnap.sources.conditions import (
    Condition,
    Heard,
    Signals,
    is_condition,
    parse_condition,
)
from neurosnap.sources.meaning import (
    RULE,
    Numbers,
    Reader,
    as_text,
    is_number,
    readers_of,
)
from neurosnap.sources.message_fields import Term, fields, parse_term


class Readers(Protocol):
    """Takes what signals say."""

    signals: tuple[str, ...]
    """The names of those that are wanted, in order."""

    def wants(self, name: str) -> bool:
        """Return whether a signal is wanted, or one within it."""

    def terms(self, topic: str) -> list[Term]:
        """Return the signals that are terms of a topic's messages."""

    def read(
        self, values: Mapping[str, object], topic: str = ""
    ) -> tuple[dict[str, bool | None], list[InvalidValueError]]:
        """Return what sensors read, by what signals say, and what is no reading.

        Args:
            values: By signal; those of others are no matter.
            topic: Of the message they are in, if it is in one.
        """


class SignalReaders:
    """Reads what signals say, for a live source; from any thread.

    Args:
        signals: How each is read.

    Attributes:
        sensors: The names of the sensors.
        heard_within: As for `LatestReadings`, one a sensor.
        signals: The names of the signals, in order.
        numbers: Those that are compared.
    """

    def __init__(self, signals: Signals) -> None:
        self.signals = tuple(signals)
        self._readers: dict[str, list[Reader]] = {
            name: readers_of(name, some) for name, some in signals.items()
        }
        each = [reader for some in self._readers.values() for reader in some]
        self.numbers = Numbers(each)
        self.sensors = tuple(reader.name for reader in each)
        self.heard_within = [
            said.within if isinstance(said := reader.condition, Heard) else None
            for reader in each
        ]
        self._terms = [term for name in signals if (term := parse_term(name))]
        self._wants = set(signals)  # and others that were asked for
        self._lock = threading.Lock()  # what a signal says next depends on the last

    def wants(self, name: str) -> bool:
        """Return whether a signal is wanted, or one within it."""
        if name in self._wants:
            return True
        inner = f"{name}.", f"{name}["
        if any(each.startswith(inner) for each in self.signals) or self.terms(name):
            self._wants.add(name)
        return name in self._wants

    def terms(self, topic: str) -> list[Term]:
        """Return the signals that are terms of a topic's messages."""
        return [term for term in self._terms if term.is_of(topic)]

    def read(
        self, values: Mapping[str, object], topic: str = ""
    ) -> tuple[dict[str, bool | None], list[InvalidValueError]]:
        """Return what sensors read, by what signals say, and what is no reading."""
        readings: dict[str, bool | None] = {}
        wrong: list[InvalidValueError] = []
        with self._lock:
            for name, value in values.items():
                for reader in self._readers.get(name, ()):
                    try:
                        readings[reader.name] = reader.read(value)
                    except ValueError as error:
                        wrong.append(_no_reading(name, error, value))
        return readings, wrong


def _no_reading(name: str, error: ValueError, value: object) -> InvalidValueError:
    """Return the error of a value, and what to do about a number."""
    said = value if isinstance(value, str) else as_text(value)
    rule = str(error)
    if rule == RULE and is_number(said):
        rule += f' (or name the sensor "{name} > NUMBER")'
    return InvalidValueError(name, rule, said[:40])


def signals_of(sensors: Sequence[str]) -> dict[str, tuple[Condition | None, ...]]:
    """Return how signals are read, by the names and conditions that a user gives."""
    found: dict[str, tuple[Condition | None, ...]] = {}
    for text in sensors:
        condition = parse_condition(text) if is_condition(text) else None
        name = condition.source if condition else text
        found[name] = (*found.get(name, ()), condition)
    return found


def flattened(values: Mapping[str, object], readers: Readers) -> dict[str, object]:
    """Return what signals say, those within lists and objects by their fields."""
    found: dict[str, object] = {}
    for name, value in values.items():
        if isinstance(value, dict | list):
            found.update(fields(name, value, readers.terms(name)))
        else:
            found[name] = value
    return found
