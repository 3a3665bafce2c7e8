"""Each message matches its schema, and viewers accept the schema."""

import json

import jsonschema  # type: ignore[import-untyped]
import pytest

from neurosnap import wire
from neurosnap.recording.format import schemas
from tests.support.foxglove_rules import refusals
from tests.support.recordings import EACH


@pytest.mark.parametrize("topic", wire.TOPICS)
def test_viewers_take_the_schema_and_the_message_is_what_it_says(topic: str) -> None:
    schema = json.loads(schemas.encoded(wire.TOPICS[topic]))
    assert refusals(schema) == []
    assert list(schema["properties"]) == ["type", *EACH[topic].__struct_fields__]
    jsonschema.validate(json.loads(wire.encode(EACH[topic])), schema)


@pytest.mark.parametrize(
    ("field", "value"),
    [("type", "wave"), ("hops", 0), ("source", "7"), ("credit", True), ("wave", 2**31)],
)
def test_what_is_no_such_message_does_not_fit(field: str, value: object) -> None:
    pulse = json.loads(wire.encode(EACH["pulse"])) | {field: value}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(pulse, schemas.schema(wire.Pulse))


def test_bytes_are_strings_in_base64_and_the_name_is_the_messages() -> None:
    bits = schemas.schema(wire.Observation)["properties"]["bits"]
    assert bits == {"type": "string", "contentEncoding": "base64"}
    assert schemas.name(wire.WaveStart) == "neurosnap.WaveStart"
