"""The JSON Schema rules of Foxglove and Lichtblick, taken from their source.

The rules are those of ``packages/mcap-support/src/parseJsonSchema.ts``, of both
programs together: the one looks at ``oneOf`` first and then needs no type, the other
looks at the type alone.
"""

from typing import Any

_PLAIN = ("boolean", "number", "integer")


def refusals(schema: Any, name: str = "root") -> list[str]:
    """Return why a schema would be refused; empty: it is taken."""
    if not isinstance(schema, dict) or schema.get("type") != "object":
        return [f"{name}: must be an object"]
    if not isinstance(schema.get("properties"), dict):
        return [f"{name}: must have properties"]
    found = []
    for field, rule in schema["properties"].items():
        where = f"{name}.{field}"
        for choice in rule.get("oneOf", []):
            if type(choice.get("const")) not in (int, float):
                found.append(f"{where}: oneOf")
        match rule.get("type"):
            case "string":
                if rule.get("contentEncoding", "base64") != "base64":
                    found.append(f"{where}: encoding")
            case "object":
                found += refusals(rule, where)
            case "array":
                found += _item_refusals(rule["items"], where)
            case kind if kind not in _PLAIN:
                found.append(f"{where}: type {kind}")
    return found


def _item_refusals(item: dict[str, Any], where: str) -> list[str]:
    match item.get("type"):
        case "object":
            return refusals(item, where)
        case "string":
            return [f"{where}: encoded items"] if "contentEncoding" in item else []
        case kind:
            return [] if kind in _PLAIN else [f"{where}: items of type {kind}"]
