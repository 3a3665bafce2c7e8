"""Run descriptions are parsed correctly, and their errors are found."""

import re
import tempfile
import tomllib
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from msgspec import inspect

from neurosnap.apps.config.load import load
from neurosnap.apps.config.problems import Keys, LineNumbers, dotted
from neurosnap.apps.config.sources import FileTable, WorldTable
from neurosnap.apps.config.tables import Config, HealthTable
from neurosnap.apps.config.validate import problems
from tools.json_schema import schema

# Each key is named after its line; of what stands behind a string of several lines
# within the same array or inline table, after the line on which that string begins.
DOCUMENT = r'''l1 = 1
# ] [l0] = """
l3 = "]}#"  # = [
"l4 x" = { l4 = [1, '"""', { l4 . l4 = true }], "l4#" = "\"[", 'l4]' = -2.5 }
l5 . l5 = """
[no] l0 = 1 # """
l7 = [  # {
  1,
  """a\"""
]""\
  b""", 2,
  1979-05-27T07:32:00Z]
l13 = QQQ
'' } [
#''QQQ
l16 = {l16 = """
""", l16b = {}}
[l18 . "l18.d"] # [
l19 = nan
  l20 . l20 = [
  [], [
]]
[[ "l23" ]]
[[l23]]
"l25 \u0041\"" = '\'
[[l23.l26]]
"" = 0
'''.replace("QQQ", "'" * 3)
ITEMS: dict[Keys, int] = {
    ("l4 x", "l4", 2): 4,
    ("l7", 0): 8,
    ("l7", 1): 9,
    ("l7", 2): 9,
    ("l7", 3): 12,
    ("l18", "l18.d", "l20", "l20", 0): 21,
    ("l18", "l18.d", "l20", "l20", 1): 21,
    ("l23", 0): 23,
    ("l23", 1): 24,
    ("l23", 1, "l26", 0): 26,
    ("l23", 1, "l26", 0, ""): 27,
}
"""The lines of items of lists, and of a key without a name."""

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


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_every_key_is_found_on_its_line_and_no_other(end: str) -> None:
    lines = LineNumbers(DOCUMENT.replace("\n", end))
    keys = set(every_key(tomllib.loads(DOCUMENT)))
    named = {key: re.match(r"l(\d+)", str(key[-1])) for key in keys}
    found = {key: lines.line(key) for key in keys}
    assert {k: n for k, n in found.items() if named[k]} == {
        key: int(name[1]) for key, name in named.items() if name
    }
    assert {key: found[key] for key in ITEMS} == ITEMS
    for key in [(), *keys]:
        assert lines.line((*key, "nowhere")) is lines.line((*key, 9)) is None


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
        given |= {"alarms": st.none(), "zone": st.none()}
    return st.fixed_dictionaries(given)


KIND = inspect.type_info(Config)
assert isinstance(KIND, inspect.StructType)
tables = {field.name: values_of(field.type) for field in KIND.fields}
tables["source"] = st.one_of(
    *(values_of(inspect.type_info(each)) for each in (WorldTable, FileTable))
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
