"""A panel layout for Foxglove and Lichtblick, made for one run.

It is the JSON that both take with "import from file": the order and the state in 3D,
what every sensor reads and is believed as coloured bars, the numbers of each tick as
curves, the log, and the decisions as they are; and the images, if there are any.
"""

import re
from collections.abc import Sequence
from typing import Any

import msgspec

from neurosnap.apps.export.foxglove_scene import FRAME
from neurosnap.apps.export.hasse_layout_3d import reach

READINGS = "/readings"
BELIEVED = "/believed"
LOG = "/log"
IMAGE = "/image"
GRAPH = "/graph"
STATE = "/graph/state"

_SHOWN = 32
"""Sensors that get bars of their own; more would be too thin to read."""
_CURVES = ("depth", "height", "edges", "pulses")
_PLAIN = re.compile(r"[a-zA-Z0-9_-]+")


def layout(sensors: Sequence[str], height: int, images: bool = False) -> bytes:
    """Return a layout as JSON.

    Args:
        sensors: The names of the run's sensors; the first 32 get bars of their own.
        height: Edges on the longest chain that is to be seen.
        images: Whether the environment was drawn.
    """
    panels = {
        "3D!order": {
            "followTf": FRAME,
            "followMode": "follow-none",
            "cameraState": _camera(reach(len(sensors), height)),
            "topics": {GRAPH: {"visible": True}, STATE: {"visible": True}},
            # Its axes would stand in the middle of the order and mean nothing.
            "transforms": {f"frame:{FRAME}": {"visible": False}},
        },
        "StateTransitions!readings": _bars("Readings", READINGS, sensors),
        "StateTransitions!believed": _bars("Believed", BELIEVED, sensors),
        "Plot!numbers": {
            **_title("Waves"),
            "paths": [_path(f"/state.{name}", name) for name in _CURVES],
            "showLegend": True,
            "legendDisplay": "floating",
            "isSynced": True,
            "xAxisVal": "timestamp",
        },
        "RosOut!log": {"topicToRender": LOG, "searchTerms": [], "minLogLevel": 1},
        "RawMessages!decisions": {"topicPath": "/decide"},
    }
    above: Any = "3D!order"
    if images:
        panels["Image!environment"] = {"imageMode": {"imageTopic": IMAGE}}
        above = _beside(above, "Image!environment", 60)
    arranged = _beside(
        _above(above, _above("RosOut!log", "RawMessages!decisions", 50), 70),
        _above(
            "StateTransitions!readings",
            _above("StateTransitions!believed", "Plot!numbers", 55),
            35,
        ),
        50,
    )
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": arranged,
    }
    return msgspec.json.format(msgspec.json.encode(whole))


def quoted(name: str) -> str:
    r"""Return a field's name as it stands in a path: in quotes, if it must.

    Example:
        >>> quoted("door"), quoted('front.door & "back"')
        ('door', '"front.door & \\"back\\""')
    """
    if _PLAIN.fullmatch(name):
        return name
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _bars(title: str, topic: str, sensors: Sequence[str]) -> dict[str, Any]:
    paths = [_path(f"{topic}.{quoted(name)}", name) for name in sensors[:_SHOWN]]
    return {**_title(title), "isSynced": True, "paths": paths}


def _title(title: str) -> dict[str, str]:
    """Return a panel's title, which each viewer keeps under a name of its own."""
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _path(value: str, label: str) -> dict[str, Any]:
    return {
        "value": value,
        "label": label,
        "enabled": True,
        "timestampMethod": "receiveTime",
    }


def _camera(far: float) -> dict[str, Any]:
    """Return a camera that sees the whole scene from the side and a little above.

    Args:
        far: How far from the origin the scene extends. Such a ball fills the view from
            2.6 times as far away.
    """
    return {
        "perspective": True,
        "distance": 3 * far,
        "phi": 75,
        "thetaOffset": 45,
        "target": [0, 0, 0],
        "targetOffset": [0, 0, 0],
        "targetOrientation": [0, 0, 0, 1],
        "fovy": 45,
        "near": 0.1,
        "far": max(5000.0, 10 * far),
    }


def _beside(first: Any, second: Any, percentage: int) -> dict[str, Any]:  # noqa: ANN401
    return _split("row", first, second, percentage)


def _above(first: Any, second: Any, percentage: int) -> dict[str, Any]:  # noqa: ANN401
    return _split("column", first, second, percentage)


def _split(
    direction: str,
    first: Any,  # noqa: ANN401 - a panel's name, or another split
    second: Any,  # noqa: ANN401
    percentage: int,
) -> dict[str, Any]:
    return {
        "direction": direction,
        "first": first,
        "second": second,
        "splitPercentage": percentage,
    }
