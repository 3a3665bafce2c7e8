import json
from typing import Any

import pytest

from neurosnap import wire
from neurosnap.recording.format import schemas
from tests.support.foxglove_rules import refusals
from tests.support.recordings import EACH

_TYPES: dict[str, Any] = {
    "string": str,
    "integer": int,
    "number": float,
    "boolean": bool,
    "array": list,
    "object": dict,
}


def breaches(rule: dict[str, Any], inside: str = "object") -> list[str]:
    """Return what viewers would not read in a schema, or in a part of one."""
    found = [key for key in rule if key in ("$ref", "anyOf", "oneOf", "allOf", "$defs")]
    if rule.get("type") not in _TYPES:
        found.append(f"type {rule.get('type')!r}")
    if rule.get("type") == "array":
        if inside == "array":
            found.append("nested array")
        if "contentEncoding" in rule["items"]:
            found.append("bytes in an array")
        found += breaches(rule["items"], "array")
    if rule.get("type") == "object":
        for part in rule["properties"].values():
            found += breaches(part)
    return found


def misfits(value: Any, rule: dict[str, Any]) -> list[str]:
    """Return where `value` is not what the schema says, for the keywords we use."""
    found = []
    if type(value) is not _TYPES[rule["type"]]:
        return [f"{value!r} is no {rule['type']}"]
    if "enum" in rule and value not in rule["enum"]:
        found.append(f"{value!r} is none of {rule['enum']}")
    if not rule.get("minimum", float("-inf")) <= _number(value):
        found.append(f"{value!r} is below {rule['minimum']}")
    if not _number(value) <= rule.get("maximum", float("inf")):
        found.append(f"{value!r} is above {rule['maximum']}")
    if rule["type"] == "array":
        for item in value:
            found += misfits(item, rule["items"])
    if rule["type"] == "object":
        found += [
            f"{name} is missing" for name in rule["required"] if name not in value
        ]
        for name, part in value.items():
            found += misfits(part, rule["properties"][name])
    return found


def _number(value: Any) -> float:
    return value if isinstance(value, int | float) else 0


@pytest.mark.parametrize("topic", wire.TOPICS)
def test_viewers_read_the_schema(topic: str) -> None:
    schema = json.loads(schemas.encoded(wire.TOPICS[topic]))
    assert refusals(schema) == []
    assert breaches(schema) == []


@pytest.mark.parametrize("topic", wire.TOPICS)
def test_the_message_is_what_its_schema_says(topic: str) -> None:
    schema = schemas.schema(wire.TOPICS[topic])
    assert misfits(json.loads(wire.encode(EACH[topic])), schema) == []
    assert list(schema["properties"]) == ["type", *EACH[topic].__struct_fields__]


@pytest.mark.parametrize(
    ("field", "value"),
    [("type", "wave"), ("hops", 0), ("source", "7"), ("credit", True), ("wave", 2**31)],
)
def test_the_check_above_notices_what_does_not_fit(field: str, value: object) -> None:
    pulse = json.loads(wire.encode(EACH["pulse"])) | {field: value}
    assert len(misfits(pulse, schemas.schema(wire.Pulse))) == 1


def test_bytes_are_strings_in_base64() -> None:
    bits = schemas.schema(wire.Observation)["properties"]["bits"]
    assert bits == {"type": "string", "contentEncoding": "base64"}


def test_the_schema_is_named_after_the_message() -> None:
    assert schemas.name(wire.WaveStart) == "neurosnap.WaveStart"
