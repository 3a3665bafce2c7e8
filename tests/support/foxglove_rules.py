"""What Foxglove and Lichtblick take, written down from their open sources.

`refusals` has the rules of ``packages/mcap-support/src/parseJsonSchema.ts``, those of
Foxglove and Lichtblick together: the one looks at ``oneOf`` first and then needs no
type, the other looks at the type alone. `steps` has the grammar of
``packages/message-path/src/grammar.ne``, for paths without slices, filters and
modifiers. `KEYS` and the sets below are from the types of the panels' configurations.
"""

import re
from typing import Any

_PLAIN = ("boolean", "number", "integer")
_STEP = re.compile(r'\.(?:([a-zA-Z0-9_-]+)|"((?:[^"\\]|\\\\|\\")*)")')
_PATH = re.compile(r"((?:/[a-zA-Z0-9_-]*)+)(.*)", re.DOTALL)

_TITLE = {"foxglovePanelTitle", "lichtblickPanelTitle"}
KEYS = {
    "3D": {"cameraState", "followMode", "followTf", "scene", "transforms", "topics"}
    | {"layers", "publish", "imageMode"},
    "Image": {"cameraState", "followMode", "followTf", "scene", "transforms", "topics"}
    | {"layers", "publish", "imageMode"},
    "StateTransitions": {"paths", "isSynced"} | _TITLE,
    "Plot": {"paths", "minXValue", "maxXValue", "minYValue", "maxYValue", "isSynced"}
    | {"showLegend", "legendDisplay", "showPlotValuesInLegend", "showXAxisLabels"}
    | {"showYAxisLabels", "xAxisVal", "xAxisPath", "followingViewWidth"}
    | {"sidebarDimension"}
    | _TITLE,
    "RosOut": {"searchTerms", "minLogLevel", "topicToRender"},
    "RawMessages": {"diffEnabled", "diffMethod", "diffTopicPath", "expansion"}
    | {"showFullMessageForDiff", "topicPath"},
}
"""What the configuration of each kind of panel may have."""

PATH = {"value", "label", "enabled", "timestampMethod", "color"}
CAMERA = {"distance", "perspective", "phi", "thetaOffset", "fovy", "near", "far"} | {
    "target",
    "targetOffset",
    "targetOrientation",
}


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


def steps(path: str) -> tuple[str, list[str]]:
    """Return the topic and the fields that a path names."""
    start = _PATH.fullmatch(path)
    assert start is not None, path
    topic, rest = start.groups()
    fields = []
    while rest:
        step = _STEP.match(rest)
        assert step is not None, path
        plain, quoted = step.groups()
        fields.append(re.sub(r'\\(["\\])', r"\1", quoted) if plain is None else plain)
        rest = rest[step.end() :]
    return topic, fields
