"""Descriptions of runs: what is written is read, and what is wrong is found."""

import tempfile
import tomllib
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from msgspec import inspect

from neurosnap.apps.config.load import load
from neurosnap.apps.config.problems import Keys, LineNumbers, dotted
from neurosnap.apps.config.sources import CsvTable, WorldTable
from neurosnap.apps.config.tables import Config, HealthTable
from neurosnap.apps.config.validate import problems
from tools.json_schema import schema

BARE = ["a", "b1", "c-d", "true", "7"]
QUOTED = {
    '"x y"': "x y",
    "'[z]'": "[z]",
    '"#"': "#",
    '"\\u0041\\""': 'A"',
    '"d.e"': "d.e",
    '""': "",
}
SCALARS = [
    "1", "-2.5", "true", "1979-05-27T07:32:00Z", "nan", '""', "''", '"]}#"',
    "'\\'", '"\\"["', "'\"\"\"'", '"\'\'\'"', '"""]"""', "'''}'''", '"""""a""\\"""""',
    "'''''b'''''",
]  # fmt: skip
LONG = [
    '"""\n[no]\nkey = 1 # """', '"""a\\"""\n]""\\\n  b"""""', "'''\n'' } [\n#'''''",
    '"""\n\n"""',
]  # fmt: skip
GAPS = ["", "\n", "# ] [a] = '\n", '\n  # """ {\n\n']


class Document(NamedTuple):
    text: str
    lines: dict[Keys, int]
    """The line of every key: the one on which it stands, or, behind a string of several
    lines within its array or inline table, the one on which the first such began."""


class Pen:
    """Writes a document, and down on which line each key is written."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.text = ""
        self.line = 1
        self.lines: dict[Keys, int] = {}

    def put(self, text: str) -> None:
        """Write something that holds no string of several lines."""
        self.text += text
        if "\n" in text:
            self.line = 1 + self.text.count("\n")

    def mark(self, keys: Keys) -> None:
        for length in range(1, len(keys) + 1):
            self.lines.setdefault(keys[:length], self.line)

    def one(self, of: list[str]) -> str:
        return self.draw(st.sampled_from(of))

    def keys(self, most: int) -> list[tuple[str, str]]:
        """Draw different keys: as they are written, and as they are meant."""
        every = [(key, key) for key in BARE] + list(QUOTED.items())
        drawn = st.lists(
            st.sampled_from(every), max_size=most, unique_by=lambda key: key[1]
        )
        return self.draw(drawn)

    def value(self, at: Keys, depth: int) -> None:
        kinds = ["scalar", "long", "list", "table"] if depth else ["scalar", "long"]
        match self.one(kinds):
            case "scalar":
                self.put(self.one(SCALARS))
            case "long":
                self.text += self.one(LONG)  # and the line stays
            case "list":
                self.put("[" + self.one(GAPS))
                for place in range(self.draw(st.integers(0, 3))):
                    self.mark((*at, place))
                    self.value((*at, place), depth - 1)
                    self.put(self.one(["", "\n"]) + "," + self.one([" ", *GAPS]))
                self.put("]")
            case _:
                self.put("{ ")
                for number, (written, key) in enumerate(self.keys(3)):
                    self.put(", " if number else "")
                    self.entry(written, (*at, key), depth - 1)
                self.put(" }")

    def entry(self, written: str, keys: Keys, depth: int) -> None:
        if self.draw(st.booleans()):
            written, keys = f"{written} . sub", (*keys, "sub")
        self.mark(keys)
        self.put(f"{written} = ")
        self.value(keys, depth)

    def entries(self, at: Keys) -> None:
        for written, key in self.keys(3):
            self.put(self.one(GAPS))
            self.entry(written, (*at, key), 2)
            self.put(self.one(["\n", " # '''\n"]))


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """Draw a document with all that TOML has to make a line hard to find."""
    pen = Pen(draw)
    pen.entries(())
    for number, (written, key) in enumerate(pen.keys(4)):
        # The names of headers begin with one of their own: none is defined twice.
        top = f"table{number}"
        if draw(st.booleans()):
            pen.mark((top, key))
            pen.put(f"[{top}.{written}] # [\n")
            pen.entries((top, key))
            continue
        for place in range(draw(st.integers(1, 3))):
            pen.mark((top, key, place))
            pen.put(f"[[ {top} . {written} ]]\n")
            pen.entries((top, key, place))
    text = pen.text if draw(st.booleans()) else pen.text.removesuffix("\n")
    return Document(text, pen.lines)


VALID = Draft202012Validator(schema())
WRONG = date(1979, 5, 27)  # no key takes a date
UNKNOWN = "zyzzyva"  # no key has this name, or one like it


# Lines --------------------------------------------------------------------------------


def every_key(value: object, at: Keys = ()) -> Iterator[Keys]:
    """Yield the way to all that a parsed document holds."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield (*at, key)
            yield from every_key(item, (*at, key))


@given(documents(), st.booleans())
def test_every_key_is_found_on_its_line(document: Document, windows: bool) -> None:
    text = document.text.replace("\n", "\r\n") if windows else document.text
    lines = LineNumbers(text)
    keys = set(every_key(tomllib.loads(text)))
    assert keys == document.lines.keys()
    assert {key: lines.line(key) for key in keys} == document.lines


@given(documents(), st.sampled_from(["nowhere", 9]))
def test_no_other_key_is_found(document: Document, other: str | int) -> None:
    lines = LineNumbers(document.text)
    for keys in [(), *document.lines]:
        assert lines.line((*keys, other)) is None


# Configs ------------------------------------------------------------------------------

names = st.text("abc/.* é\"'\\\n#[]", min_size=1, max_size=8)


def values_of(kind: inspect.Type) -> st.SearchStrategy[Any]:
    """Return what a key of a kind may hold."""
    match kind:
        case inspect.Metadata():
            return values_of(kind.type)
        case inspect.StructType(tag_field=str(field)):
            return fields_of(kind).map(lambda table: {field: kind.tag, **table})
        case inspect.StructType():
            return fields_of(kind)
        case inspect.UnionType():
            return st.one_of(*map(values_of, kind.types))
        case inspect.VarTupleType():
            return st.lists(values_of(kind.item_type), max_size=3)
        case inspect.DictType():
            return st.dictionaries(names, values_of(kind.value_type), max_size=3)
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.StrType(pattern=str()):
            return names.map("{}.csv".format)
        case inspect.StrType():
            return names
        case inspect.IntType():
            low = -(2**63) if kind.ge is None else kind.ge
            return st.integers(low, 2**63 - 1 if kind.le is None else kind.le)
        case inspect.FloatType():
            return st.floats(
                kind.ge if kind.gt is None else kind.gt,
                kind.le if kind.lt is None else kind.lt,
                exclude_min=kind.gt is not None,
                exclude_max=kind.lt is not None,
                allow_nan=False,
                allow_infinity=False,
            )
        case _:
            return st.booleans() if isinstance(kind, inspect.BoolType) else st.none()


def fields_of(kind: inspect.StructType) -> st.SearchStrategy[Any]:
    given = {field.name: values_of(field.type) for field in kind.fields}
    if kind.cls is HealthTable:
        given["alarms"] = st.none()
    return st.fixed_dictionaries(given)


KIND = inspect.type_info(Config)
assert isinstance(KIND, inspect.StructType)
tables = {field.name: values_of(field.type) for field in KIND.fields}
tables["source"] = st.one_of(
    *(values_of(inspect.type_info(each)) for each in (WorldTable, CsvTable))
)
configs = st.fixed_dictionaries(tables).map(
    lambda table: msgspec.convert(table, Config)
)


@pytest.fixture(scope="module")
def file() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "swarm.toml"


def as_toml(config: Config) -> bytes:
    """Return a description as a file has it: what is None is left out."""
    tables = msgspec.to_builtins(config, builtin_types=(date,))
    for name, table in tables.items():
        tables[name] = {key: one for key, one in table.items() if one is not None}
    return msgspec.toml.encode(tables)


@given(config=configs)
def test_what_is_written_is_read(file: Path, config: Config) -> None:
    encoded = as_toml(config)
    file.write_bytes(encoded)
    assert load(file).config == config
    assert VALID.is_valid(tomllib.loads(encoded.decode()))


@st.composite
def mutated(draw: st.DrawFn) -> tuple[dict[str, Any], Keys]:
    """Draw a config with one thing wrong in it, and the way to that."""
    # As TOML has it, so that there are lists and no tuples.
    table = tomllib.loads(as_toml(draw(configs)).decode())
    free = ("source", "arguments")
    ways = [keys for keys in every_key(table) if keys[:2] != free or len(keys) < 4]
    keys = draw(st.sampled_from(ways))
    inner: Any = table
    for key in keys[:-1]:
        inner = inner[key]
    below = inner[keys[-1]]
    if isinstance(below, dict) and keys != free and draw(st.booleans()):
        below[UNKNOWN] = draw(st.integers() | st.just({}) | st.just([]))
        return table, (*keys, UNKNOWN)
    inner[keys[-1]] = WRONG
    return table, keys


@given(mutation=mutated())
def test_one_thing_wrong_is_found_where_it_is(
    file: Path, mutation: tuple[dict[str, Any], Keys]
) -> None:
    table, keys = mutation
    text = msgspec.toml.encode(table).decode()
    file.write_text(text, encoding="utf-8", newline="")
    loaded = load(file)
    error = loaded.origin.error(loaded.found)
    (fault,) = error.faults
    mark = UNKNOWN if keys[-1] == UNKNOWN else str(WRONG)
    (line,) = (n for n, part in enumerate(text.split("\n"), 1) if mark in part)
    assert (fault.key, fault.line, fault.file) == (dotted(keys), line, str(file))
    assert fault.said.startswith("must be ")
    assert str(error) == f"{file}:{line}: {dotted(keys)}: {fault.said}"
    assert not VALID.is_valid(table)


values = st.one_of(
    st.sampled_from([0, 1, -1, 2**63 - 1, 2**63, 0.0, 0.25, 1.0, True, False, ""]),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(max_size=3),
    st.sampled_from(["walker", "hasse", "worker", "never", "a.csv", "csv", "world"]),
    st.lists(st.text(max_size=2) | st.integers(), max_size=2),
    st.just({}),
)


@given(configs, st.data())
def test_the_schema_refuses_what_the_walk_refuses(
    config: Config, data: st.DataObject
) -> None:
    table = tomllib.loads(as_toml(config).decode())
    keys = data.draw(st.sampled_from(list(every_key(table))))
    inner: Any = table
    for key in keys[:-1]:
        inner = inner[key]
    value = inner[keys[-1]] = data.draw(values)
    found = problems(table, Config)
    # To a schema 1.0 is a whole number; to whoever writes a count, it is not.
    if isinstance(value, float) and value.is_integer():
        assert found or VALID.is_valid(table)
    else:
        assert VALID.is_valid(table) == (not found)
    try:
        msgspec.convert(table, Config)
    except msgspec.ValidationError:
        assert found
