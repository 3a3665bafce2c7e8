"""Loads a run's description from a TOML file and command-line options."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec

from neurosnap.apps.config.problems import (
    ConfigError,
    ConfigFault,
    Keys,
    LineNumbers,
    dotted,
    said_of,
)
from neurosnap.apps.config.sources import Opening
from neurosnap.apps.config.tables import Config
from neurosnap.apps.config.validate import Problem, problems
from neurosnap.errors import InvalidValueError
from neurosnap.system.durable import opened_file

_MOST = 100
_LARGEST = 4 << 20  # bytes of a file
_DEEPEST = 20  # dots of a key: the time that is taken by them is quadratic
_DEEP = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{_DEEPEST + 1}}}""")
_NO_SOURCE = {"kind": "world", "id": "-"}  # stands where none can be read; never opened
_PATHS = {"recording.path", "recording.folder", "network.tls"}
_RECORDING = {
    f"recording.{key}" for key in ("path", "folder", "frames", "split", "keep")
}
"""Keys that are of no use where nothing is recorded."""
_PLACE = re.compile(r" \((?:at line (\d+), (column \d+)|at end of document)\)$")


class Origin:
    """Where the values of a description come from.

    Args:
        path: The file; None if there is none.
        text: What is in it.
        given: What the command line says: the names it has there, by key.
    """

    def __init__(self, path: Path | None, text: str, given: Mapping[Keys, str]) -> None:
        self._path = path
        self._lines = LineNumbers(text)
        self._given = dict(given)

    @property
    def folder(self) -> Path:
        """What paths in the file are relative to."""
        return Path() if self._path is None else self._path.parent

    def fault(
        self, keys: Keys, rule: str, value: object = msgspec.UNSET
    ) -> ConfigFault:
        """Return the fault in the value of a key, with its line in the file.

        What is not there itself stands where its table does.
        """
        said = said_of(rule, value)
        for length in range(len(keys), 0, -1):
            if keys[:length] in self._given:
                rest = dotted(keys[length:])
                name = self._given[keys[:length]]
                return ConfigFault(key=f"{name}: {rest}" if rest else name, said=said)
        if self._path is None:
            return ConfigFault(key=dotted(keys), said=said)
        line = self._lines.line(keys)
        if line is None and any(key[: len(keys)] == keys for key in self._given):
            return ConfigFault(key=dotted(keys), said=said)
        for length in range(len(keys) - 1, 0, -1):
            line = self._lines.line(keys[:length]) if line is None else line
        return ConfigFault(file=str(self._path), line=line, key=dotted(keys), said=said)

    def error(self, found: Sequence[Problem]) -> ConfigError:
        """Return the error that reports problems, in the order of their lines.

        It reports the first 100: where there are more, one mistake was made over and
        over, and to find a line takes a while.
        """
        faults = [self.fault(*problem) for problem in found[:_MOST]]
        faults.sort(key=lambda fault: (fault.file is not None, fault.line or 0))
        return ConfigError(faults, more=len(found) - len(faults))


class Loaded(msgspec.Struct, frozen=True):
    """A loaded description of a run, each of whose values is valid by itself."""

    config: Config
    """What it says; a table with a wrong value is left out, and has its defaults."""
    origin: Origin
    """Where it says so."""
    found: tuple[Problem, ...] = ()
    """What is wrong with values alone."""

    @property
    def wrong(self) -> set[str | int]:
        """The tables that are left out."""
        return {problem.keys[0] for problem in self.found}


def described(
    source: str, given: Mapping[str, object], names: Mapping[str, str]
) -> Loaded:
    """Read the description of a run by its source and what is given besides.

    Args:
        source: A TOML file that describes the run; or a world, or readings.
        given: As the overrides of `load`; paths are relative to the working folder.
        names: As in `load`.

    Raises:
        ConfigError: As in `load`.
        InvalidValueError: A key of a recording is given, and nothing is recorded.
    """
    overrides, names = dict(given), dict(names)
    file = Path(source) if source.lower().endswith(".toml") else None
    if file is None:
        # Readings, too: opening them tells them apart.
        overrides |= {"source.kind": "world", "source.id": source}
        names["source.id"] = "source"
    for key in _PATHS & overrides.keys():
        # Without a path there is none, whatever the file says.
        if isinstance(path := overrides[key], str) and path and file is not None:
            overrides[key] = str(Path(path).absolute())
    loaded = load(file, overrides, names)
    recorded = loaded.config.recording.record or "recording" in loaded.wrong
    for key in () if recorded else _RECORDING & given.keys():
        if given[key]:
            rule = "must go with a recording, and nothing is recorded"
            raise InvalidValueError(names.get(key, key), rule, str(given[key]))
    return loaded


def named_source(source: str) -> Opening:
    """Return the source of a name: a world, readings, or that of a TOML file."""
    loaded = described(source, {}, {})
    if loaded.found:
        raise loaded.origin.error(loaded.found)
    return loaded.config.source.opening(loaded.origin.folder)


def load(
    path: Path | None,
    overrides: Mapping[str, object] = MappingProxyType({}),
    names: Mapping[str, str] = MappingProxyType({}),
) -> Loaded:
    """Read a description of a run, and judge every value in it alone.

    Args:
        path: A TOML file; None if all is in `overrides`.
        overrides: What goes before the file: values by dotted keys
            (``"snapshot.threshold"``); paths among them are absolute, or relative to
            the file's folder. A table replaces all of its keys.
        names: What overrides are called where they were given, by the same keys; a key
            is called as it is unless it is among them.

    Raises:
        ConfigError: The file cannot be read, or is no TOML.

    Examples:
        >>> load(None, {"source": {"kind": "file", "path": "a.csv"}}).config.source
        FileTable(path='a.csv', arguments={})
    """
    text = "" if path is None else _text(path)
    table = {} if path is None else _parsed(path, text)
    given = {
        tuple[str | int, ...](key.split(".")): names.get(key, key) for key in overrides
    }
    origin = Origin(path, text, given)
    whole = _merged(table, overrides)
    found = tuple(problems(whole, Config))
    left_out = {problem.keys[0] for problem in found}
    right = {key: value for key, value in whole.items() if key not in left_out}
    if "source" in left_out:
        right["source"] = _NO_SOURCE
    return Loaded(msgspec.convert(right, Config), origin, found)


def _text(path: Path) -> str:
    try:
        # As tomllib reads files: in UTF-8, whatever the system writes otherwise.
        with opened_file(path) as file:
            text = file.read(_LARGEST + 1).decode().replace("\r\n", "\n")
        if len(text) > _LARGEST:
            rule = f"must have at most {_LARGEST >> 20} MiB"
        elif _DEEP.search(text):
            rule = f"must have keys of at most {_DEEPEST} dots"
        else:
            return text
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
    except UnicodeDecodeError as error:
        rule = f"must be UTF-8 text ({error.reason} at byte {error.start})"
    raise ConfigError([ConfigFault(file=str(path), key="", said=rule)])


def _parsed(path: Path, text: str) -> dict[str, Any]:
    """Return what is in a TOML file."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        line, said = None, "nested too deep"
    except ValueError as error:  # tomllib's own is one, and so is a number too long
        place = _PLACE.search(str(error))
        said = str(error)[: place.start()] if place else str(error)
        line = 1 + text.rstrip("\n").count("\n") if place else None
        if place and place[1]:
            line, said = int(place[1]), f"{said} ({place[2]})"
    raise ConfigError(
        [ConfigFault(file=str(path), line=line, key="", said=f"must be TOML: {said}")]
    )


def _merged(table: dict[str, Any], overrides: Mapping[str, object]) -> dict[str, Any]:
    """Return a table with overrides put in; what is no table stays, to be refused."""
    merged = deepcopy(table)
    for key, value in overrides.items():
        *way, last = key.split(".")
        inner: Any = merged
        for step in way:
            inner = inner.setdefault(step, {}) if isinstance(inner, dict) else inner
        if isinstance(inner, dict):
            inner[last] = value
    return merged
