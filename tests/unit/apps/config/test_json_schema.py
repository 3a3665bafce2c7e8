"""The TOML file, its schema and the run options have the same rules."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]

from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.config.problems import dotted
from neurosnap.apps.config.sources import WorldTable
from neurosnap.apps.config.tables import Config, flattened
from neurosnap.apps.config.validate import known_keys, problems
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.protocol.option_declaration import declared
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sensorium import Sensorium
from tools.json_schema import schema

EXAMPLES = Path(__file__).parents[4] / "examples"


# Rules that are stated elsewhere, too -------------------------------------------------


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
        table = {"source": {"kind": "world", "id": "x"}, "snapshot": {name: value}}
        assert taken == (not problems(table, Config))


def test_each_declared_option_is_a_key_and_comes_back_flat() -> None:
    keys = {dotted(keys) for keys in known_keys(Config)}
    options = declared(RunOptions)
    assert len(options) == 22
    assert {one.shown.at for one in options} <= keys
    described = Config(source=WorldTable(id="x"))
    settled = {one.field for one in options if one.shown.default or one.default is None}
    plain = {one.field: one.default for one in options if one.field not in settled}
    assert flattened(described) == plain | {"watch": True}


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


def test_the_example_is_right_and_has_every_table() -> None:
    path = EXAMPLES / "swarm.toml"
    text = path.read_text(encoding="utf-8")
    assert list(tomllib.loads(text)) == list(Config.__struct_fields__)
    assert text.startswith("#:schema swarm.schema.json\n")
    Draft202012Validator(schema()).validate(tomllib.loads(text))
    assert prepare(load(path)).options.agent == "planner"
