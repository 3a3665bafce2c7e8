"""JSON schemas of the messages, in the form that viewers read.

Foxglove and Lichtblick take a schema only if its root is an object with `properties`,
every property names its `type`, arrays name the type of their items, and nothing uses
`$ref`, `anyOf`, null or an array of arrays. What msgspec derives has a reference at the
root and leaves the type of an enumeration unsaid; both are fixed here.
"""

import functools
from typing import Any

import msgspec

from neurosnap.wire import Image, Message

ENCODING = "jsonschema"
_DIALECT = "https://json-schema.org/draft/2020-12/schema"

_FOREIGN: dict[type[Message], str] = {Image: "foxglove.CompressedImage"}
"""The schemas of others that a message has all fields of; viewers go by the name."""


def name(message: type[Message]) -> str:
    """Return the name a message's schema is recorded under."""
    return _FOREIGN.get(message, f"neurosnap.{message.__name__}")


def schema(message: type[Message]) -> dict[str, Any]:
    """Return the flat JSON schema of a message, as JSON-able objects."""
    _, components = msgspec.json.schema_components([message])
    flat = components[message.__name__]
    properties = {
        field: _plain(rule, components) for field, rule in flat["properties"].items()
    }
    titled = {**flat, "title": _FOREIGN.get(message, message.__name__)}
    return {"$schema": _DIALECT, **titled, "properties": properties}


def _plain(rule: dict[str, Any], components: dict[str, Any]) -> dict[str, Any]:
    """Return a property's schema without a reference, and with its type."""
    if (reference := rule.get("$ref")) is not None:
        held = components[reference.rpartition("/")[2]]
        inside = {k: _plain(one, components) for k, one in held["properties"].items()}
        return {**held, "properties": inside}
    if "items" in rule:
        return {**rule, "items": _plain(rule["items"], components)}
    return {"type": "string", **rule} if "enum" in rule else rule


@functools.cache
def encoded(message: type[Message]) -> bytes:
    """Return the flat JSON schema of a message as JSON."""
    return msgspec.json.encode(schema(message))
