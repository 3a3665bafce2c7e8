"""The rules of a file are those of a run, and its schema says them."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import pytest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from msgspec import inspect

from neurosnap.apps.config.json_schema import _in_toml, schema
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.config.tables import Config
from neurosnap.apps.config.validate import problems
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import DiscountedSnapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sensorium import Sensorium

EXAMPLES = Path(__file__).parents[4] / "examples"


# Rules that are stated elsewhere, too -------------------------------------------------


def checked(key: str, value: float) -> bool:
    *way, last = key.split(".")
    table: Any = {"source": {"kind": "world", "id": "x"}}
    inner = table
    for step in way:
        inner = inner.setdefault(step, {})
    inner[last] = value
    return not problems(table, Config)


EDGES = [-1.0, -5e-324, 0.0, 5e-324, 0.25, math.nextafter(0.25, 1), math.nan, math.inf]
EDGES += [math.nextafter(1, 0), 1.0, math.nextafter(1, 2), -math.inf]


@pytest.mark.parametrize("value", EDGES)
def test_a_snapshot_takes_what_a_file_may_say(value: float) -> None:
    for name in ("threshold", "decay"):
        try:
            given: Any = {name: value}
            DiscountedSnapshot(Sensorium(["a"]), **given)
        except InvalidValueError:
            taken = False
        else:
            taken = True
        assert checked(f"snapshot.{name}", value) == taken


def test_options_have_the_same_rules_in_a_file() -> None:
    def rules(kind: type[msgspec.Struct]) -> dict[str, inspect.Field]:
        described = inspect.type_info(kind)
        assert isinstance(described, inspect.StructType)
        return {field.name: field for field in described.fields}

    options = rules(RunOptions)
    compared = []
    for table in rules(Config).values():
        if isinstance(table.type, inspect.StructType):
            for name, field in rules(table.type.cls).items():
                same = options.get(table.name if name == "kind" else name)
                # Where cells are may be left to be chosen, and is written down.
                choice = (table.name, name) == ("cells", "kind")
                if same is not None and name != "target" and not choice:
                    assert required(field.type) == required(same.type), name
                    assert (
                        name in ("ticks", "watch", "sync", "alarms", "workers")
                        or field.default == same.default
                    ), name
                    compared.append(name)
    assert len(compared) == 21


def required(kind: inspect.Type) -> list[inspect.Type]:
    """Return what a value is where there is one."""
    choices = kind.types if isinstance(kind, inspect.UnionType) else (kind,)
    return [one for one in choices if not isinstance(one, inspect.NoneType)]


# The schema ---------------------------------------------------------------------------


def test_the_schema_is_one_and_everything_in_it_is_described() -> None:
    made = schema()
    Draft202012Validator.check_schema(made)
    assert made["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    for table in made["$defs"].values():
        assert table["additionalProperties"] is False
        assert table["description"]
        for name, key in table["properties"].items():
            assert name == "kind" or key["description"], (table["title"], name)
    assert '"null"' not in json.dumps(made)


def test_the_schema_beside_the_example_is_the_one() -> None:
    # Made by: neurosnap config schema > examples/swarm.schema.json
    text = (EXAMPLES / "swarm.schema.json").read_text(encoding="utf-8")
    assert json.loads(text) == schema()


def test_the_example_is_right_and_has_every_table() -> None:
    path = EXAMPLES / "swarm.toml"
    text = path.read_text(encoding="utf-8")
    assert list(tomllib.loads(text)) == list(Config.__struct_fields__)
    assert text.startswith("#:schema swarm.schema.json\n")
    Draft202012Validator(schema()).validate(tomllib.loads(text))
    assert prepare(load(path)).options.agent == "planner"


class Optional(msgspec.Struct):
    """What may be null in JSON."""

    one: int | None = None
    two: int | str | None = None
    table: dict[str, int] = {}


def test_what_toml_cannot_say_is_not_in_the_schema() -> None:
    made = _in_toml(msgspec.json.schema(Optional))
    assert made["$defs"]["Optional"]["properties"] == {
        "one": {"type": "integer"},
        "two": {"anyOf": [{"type": "integer"}, {"type": "string"}]},
        "table": {"type": "object", "additionalProperties": {"type": "integer"}},
    }
