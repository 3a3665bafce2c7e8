"""Problems found in a run's description, with their places."""

import re
from collections.abc import Sequence

import msgspec

from neurosnap.apps.config.line_numbers import Keys
from neurosnap.errors import InvalidValueError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


class ConfigFault(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that is wrong."""

    file: str | None = None
    """The file it stands in; None: it was given on the command line."""
    line: int | None = None
    """Where in the file, from 1 up; None: it is not there, though it should be."""
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
    """A description of a run is refused; the text has a line for every fault told.

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

    Example:
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
