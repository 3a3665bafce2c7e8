"""The language of conditions: when a sensor is on, by what its signal says."""

import math
import re
import unicodedata
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

from neurosnap.errors import InvalidValueError

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""A number in a text, as a pattern."""
_UNIT = r"(?:[^\s\d,<>.+-][^\s,<>]*)?"
_WHEN = re.compile(
    rf"(?P<name>.*?)\s*(?P<sign>[<>])\s*(?P<limit>{NUMBER})\s*(?P<unit>{_UNIT})"
    rf"(?:\s*,\s*off\s*(?P<back>[<>])\s*(?P<release>{NUMBER})\s*(?P<same>{_UNIT}))?",
    re.ASCII,
)
_CHANGE = re.compile(r"(?:(?P<name>.*\S)\s+)?(?P<kind>changes|rises|falls)")
_HEARD = re.compile(r"(?:(?P<name>.*\S)\s+)?heard\s+within\s+(?P<span>.+)")
_SPAN = re.compile(rf"(?P<span>{NUMBER})\s*(?P<unit>ms|s|min|h|d)?")
_SECONDS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}
_EQUALS = re.compile(r"(?P<name>[^<>=]*?)\s*=\s*(?P<word>[^<>=]*[^<>=\s])\s*")
_SHAPES = (_CHANGE, _HEARD, _EQUALS, _WHEN)
Bound: TypeAlias = tuple[float, int]
"""A number where a stretch begins or ends, and 0 if that is in it; else 1 or -1."""


class Comparison(NamedTuple):
    """Says when a sensor with a number is on: above a limit, or below it."""

    source: str
    """What the sensor is called in the data."""
    above: bool
    """On above the limit, or below it."""
    limit: float
    release: float | None = None
    """Off beyond this, on the other side; between the two, both included, as it was
    before. None if it is off wherever it is not on."""
    unit: str = ""
    """What both are in, as `plain_unit` has it; empty if that was not said."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source}{self._sign}{_plain(self.limit)}{self.unit}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        unit, back = f" {self.unit}" if self.unit else "", ""
        if self.release is not None:
            back = f", off {'<' if self.above else '>'} {self.release!r}{unit}"
        return f"{self._sign} {self.limit!r}{unit}{back}"

    @property
    def _sign(self) -> str:
        return ">" if self.above else "<"

    def span(self, *, on: bool) -> tuple[Bound, Bound]:
        """Return from where to where the number may be while it is on, or off."""
        sign = 1 if self.above else -1
        low, high = (-math.inf, 0), (sign * self.limit, 0)
        if on:
            low, high = (sign * self.limit, 1), (math.inf, 0)
            if self.release is not None:
                low = sign * self.release, 0
        if self.above:
            return low, high
        return (-high[0], -high[1]), (-low[0], -low[1])

    def is_on(self, value: float, before: bool | None) -> bool | None:
        """Return what a number says, or what was said before where it says nothing."""
        sign = 1 if self.above else -1
        if sign * value > sign * self.limit:
            return True
        if self.release is None or sign * value < sign * self.release:
            return False
        return before


class Choice(NamedTuple):
    """A word that a sensor is on at; it is off at any other."""

    source: str
    """What the sensor is called in the data."""
    word: str
    """In small letters."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source}={self.word}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return f"= {self.word}"


class Change(NamedTuple):
    """A sensor that is on where a signal says another value than before."""

    source: str
    """What the signal is called in the data."""
    kind: str
    """``changes``; or of a number ``rises`` or ``falls``."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source} {self.kind}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return self.kind

    def is_on(self, value: Any, before: Any) -> bool:  # noqa: ANN401
        """Return whether it is on at a number, behind another; or at a word."""
        if self.kind == "changes":
            return bool(value != before)
        return bool(value > before if self.kind == "rises" else value < before)


class Heard(NamedTuple):
    """A sensor that is on while messages come, whatever these say."""

    source: str
    """What the topic, or the signal, is called in the data."""
    within: float
    """Seconds after one in which the sensor is on."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source} {self.text}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return f"heard within {_plain(self.within)} s"


Condition: TypeAlias = Comparison | Choice | Change | Heard
"""Says when a sensor is on: by a number, a word, a change, or by any message."""
Signals: TypeAlias = Mapping[str, tuple[Condition | None, ...]]
"""When the sensors of each signal are on; None: as it says by itself."""


def _plain(number: float) -> str:
    """Return a number as it is written in a name."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def plain_unit(unit: str) -> str:
    """Return a unit with letters that look alike made the same.

    Examples:
        >>> plain_unit("\N{MICRO SIGN}m") == plain_unit("\N{GREEK SMALL LETTER MU}m")
        True
    """
    return unicodedata.normalize("NFC", unit).replace("\N{MICRO SIGN}", "\u03bc")


def parse_condition(text: str, name: str = "") -> Condition:
    """Parse a condition, as a user writes it.

    Args:
        text: ``hall > 21 °C, off < 20``, ``mode = auto``, ``level rises`` (or
            ``falls``, ``changes``), or ``/scan heard within 0.5 s``.
        name: What the signal is called in the data; if empty, the text says it.

    Raises:
        InvalidValueError: It says nothing of the kind.

    Examples:
        >>> parse_condition("hall > 21 °C, off < 20").name
        'hall>21°C'
        >>> parse_condition("heard within 500 ms", "/scan").name
        '/scan heard within 0.5 s'
    """
    said = text.strip()
    if name and said.startswith("=") and said != "=":  # any word
        return Choice(name, said[1:].strip().casefold())
    if match := _CHANGE.fullmatch(said):
        source = _one(name, match["name"], text)
        return Change(source, match["kind"])
    if match := _HEARD.fullmatch(said):
        within = parse_span(match["span"], "when")
        if not within:
            raise InvalidValueError("when", "must be within more than no time", text)
        return Heard(_one(name, match["name"], text), within)
    if match := _EQUALS.fullmatch(said):
        return Choice(_one(name, match["name"], text), match["word"].casefold())
    return _parsed_comparison(text, name)


def parse_span(text: str, name: str) -> float:
    """Return a time in seconds, as a user writes it: ``0.1``, ``100 ms``, ``2h``.

    Raises:
        InvalidValueError: It is none; `name` says which.
    """
    match = _SPAN.fullmatch(text.strip())
    seconds = float(match["span"]) * _SECONDS[match["unit"] or "s"] if match else -1
    if not 0 <= seconds < math.inf:
        rule = "must be a time such as 0.5, 500ms, 2 s, 10min, 1h or 1d"
        raise InvalidValueError(name, rule, text)
    return seconds


def is_condition(text: str) -> bool:
    """Return whether a text looks like a condition with the name of its signal.

    One that breaks a rule does, too, so that `parse_condition` says which.
    """
    shapes = (shape.fullmatch(text.strip()) for shape in _SHAPES)
    return any(match is not None and match["name"] for match in shapes)


def _one(name: str, said: str | None, text: str) -> str:
    """Return the name of a signal, which is given once."""
    if bool(name) == bool(said):
        raise InvalidValueError("when", _rule(name), text)
    return name or said or ""


def _rule(name: str) -> str:
    """Return what a condition must be."""
    like = "" if name else "hall "
    return (
        f'must be like "{like}> 21", "{like}> 21 °C, off < 20", "{like}= warm",'
        f' "{like}rises" (falls, changes) or "{like}heard within 5 s"'
    )


def _parsed_comparison(text: str, name: str) -> Comparison:
    match = _WHEN.fullmatch(text.strip())
    if match is None or match["back"] == match["sign"]:
        raise InvalidValueError("when", _rule(name), text)
    source = _one(name, match["name"].strip(), text)
    above, limit = match["sign"] == ">", float(match["limit"])
    release = None if match["release"] is None else float(match["release"])
    if release == limit:
        release = None
    if release is not None and (release > limit if above else release < limit):
        side = "below" if above else "above"
        rule = f"must let the sensor be off {side} where it is on"
        raise InvalidValueError("when", rule, text)
    unit = plain_unit(match["unit"])
    if match["same"] and plain_unit(match["same"]) != unit:
        raise InvalidValueError("when", "must have one unit", text)
    return Comparison(source, above, limit, release, unit)
