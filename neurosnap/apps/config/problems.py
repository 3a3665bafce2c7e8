"""Problems found in a run's description, and their line numbers.

`tomllib` says what is in a document, and not where. But it can be asked what is in the
document up to some line: the first line up to which it knows a key is the key's own.
Nothing here reads keys or values a second time, so that nothing can disagree with
`tomllib`; all that is scanned for is where a text may be cut, and which brackets are
open there.
"""

import bisect
import re
import tomllib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import msgspec

from neurosnap.errors import InvalidValueError

Keys: TypeAlias = tuple[str | int, ...]
"""The way to a value: the keys of tables, the numbers of array items from 0 up."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")
# Strings of several lines may end with two more quotes, which belong to them.
_TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?"{3,5}|\'{3}.*?\'{3,5}|"(?:\\.|[^"\\])*"|'[^']*'|#[^\n]*'''
    r"|[\[\]{}\n]",
    re.DOTALL,
)
_KEPT = 64  # documents
_CLOSING = {"[": "]", "{": "}"}


class ConfigFault(msgspec.Struct, frozen=True, kw_only=True):
    """One problem in a run's description."""

    file: str | None = None
    """The file it stands in; None if it was given on the command line."""
    line: int | None = None
    """Where in the file, from 1 up; None if it is missing there."""
    key: str
    """The way to it, as TOML writes keys, or its name on the command line."""
    said: str
    """The rule it breaks, and the value it has, if it has one."""

    def __str__(self) -> str:
        """Return it as one line."""
        line = "" if self.line is None else f":{self.line}"
        where = "" if self.file is None else f"{self.file}{line}: "
        return f"{where}{self.key}: {self.said}" if self.key else f"{where}{self.said}"


class ConfigError(InvalidValueError):
    """A run's description is refused; the text has one line for each reported problem.

    Args:
        faults: What is wrong with it; at least one thing.
        more: How many other things are.
    """

    def __init__(self, faults: Sequence[ConfigFault], more: int = 0) -> None:
        super().__init__("config", "must be without faults", len(faults) + more)
        lines = [*map(str, faults), *([f"and {more} more"] if more else [])]
        self.args = ("\n".join(lines),)
        self.faults = tuple(faults)
        self.more = more


def said_of(rule: str, value: object) -> str:
    """Return a rule and the value that breaks it; `UNSET`: there is none."""
    if value is msgspec.UNSET:
        return rule
    return str(InvalidValueError("", rule, value)).removeprefix(": ")


def dotted(keys: Keys) -> str:
    """Return the way to a value as TOML writes it.

    Examples:
        >>> dotted(("sensors", 3, "a b"))
        'sensors[3]."a b"'
    """
    text = ""
    for key in keys:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            bare = _BARE.fullmatch(key)
            text += f".{key if bare else msgspec.json.encode(key).decode()}"
    return text.removeprefix(".")


class _Cut(NamedTuple):
    end: int
    """Where the text may be cut."""
    closing: str
    """What closes the brackets that are open there."""


class LineNumbers:
    """Finds the line on which a key of a TOML document stands.

    Args:
        text: A TOML document, for which ``tomllib.loads(text)`` raises nothing.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._cuts = _cuts(text)
        # Keys looked for one after the other stand close, and share most of the way.
        self._upto = lru_cache(_KEPT)(self._parsed)

    def line(self, keys: Keys) -> int | None:
        """Return the line, from 1 up, on which a key stands, or a table's header.

        The way to it may be implied, as ``a`` is by ``[a.b]``. Of what stands behind a
        string of several lines within the same array or inline table, it is the line on
        which that string begins.

        Returns:
            None if there is no such key. O(log L) parses, for L lines.
        """
        # What a document holds up to a line only grows with the line.
        place = bisect.bisect_left(
            range(len(self._cuts)), True, key=lambda cut: _holds(self._upto(cut), keys)
        )
        if place == len(self._cuts):
            return None
        begin = self._cuts[place - 1].end if place else 0
        return 1 + self._text.count("\n", 0, begin)

    def _parsed(self, place: int) -> dict[str, object]:
        end, closing = self._cuts[place]
        return tomllib.loads(f"{self._text[:end]}\n{closing}")


def _cuts(text: str) -> list[_Cut]:
    """Return the ends of all lines that end outside of a string."""
    cuts: list[_Cut] = []
    closing = ""
    for token in _TOKEN.finditer(text):
        match token[0]:
            case "\n":
                cuts.append(_Cut(token.end(), closing))
            case "[" | "{" as bracket:
                closing = _CLOSING[bracket] + closing
            case "]" | "}":
                closing = closing[1:]
    return [*cuts, _Cut(len(text), "")]


def _holds(value: Any, keys: Keys) -> bool:  # noqa: ANN401 - whatever TOML holds
    for key in keys:
        match value:
            case dict() if key in value:
                value = value[key]
            case list() if isinstance(key, int) and key < len(value):
                value = value[key]
            case _:
                return False
    return True
