"""JSON schemas of the exported Foxglove messages.

The schemas of scenes and log lines are Foxglove's own, from its npm package
``@foxglove/schemas`` 2.1.0. They leave the type of enumerations unsaid, which some
viewers refuse, as `neurosnap.recording.format.schemas` tells; so it is said here.

`foxglove-sdk` (0.30.3) was measured and does not take their place. Its writer numbers
messages by itself and knows one time for each, so that of what is copied the sender's
running number and the time of sending would be lost. Its schemas are protobuf only. It
writes 12,000 messages in 30 ms for 58 ms here, of 270 ms that the export takes, and the
file has 0.39 MB for 0.48 MB; for that it is a wheel of 19 MB, 55 MB once installed,
where the two schemas have 38 kB and no dependency.
"""

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import msgspec

LOG = "foxglove.Log"
SCENE = "foxglove.SceneUpdate"
SIGNS = "neurosnap.Signs"

UNKNOWN = -1
"""Neither on nor off. A number and not null, since viewers would take what is left out
for no change."""


@cache
def foxglove(name: str) -> bytes:
    """Return one of Foxglove's schemas, `LOG` or `SCENE`, as JSON."""
    file = (
        files("neurosnap.apps.export") / "foxglove" / f"{name.partition('.')[2]}.json"
    )
    return msgspec.json.encode(_typed(msgspec.json.decode(file.read_bytes())))


def signs(names: Sequence[str]) -> bytes:
    """Return the schema of one number a sensor: 1 on, 0 off, -1 unknown.

    Foxglove writes those names beside the numbers; Lichtblick has the numbers alone.
    """
    titles = {"on": 1, "off": 0, "unknown": UNKNOWN}
    rule = _typed({"oneOf": [{"title": t, "const": n} for t, n in titles.items()]})
    schema = {
        "type": "object",
        "title": SIGNS,
        "description": "One number a sensor: 1 on, 0 off, -1 unknown.",
        "properties": dict.fromkeys(names, rule),
    }
    return msgspec.json.encode(schema)


def _typed(rule: Any) -> Any:  # noqa: ANN401 - any JSON
    """Return a schema whose enumerations say that they are of integers."""
    if isinstance(rule, list):
        return [_typed(part) for part in rule]
    if not isinstance(rule, dict):
        return rule
    typed = {key: _typed(part) for key, part in rule.items()}
    return {"type": "integer", **typed} if "oneOf" in rule else typed
