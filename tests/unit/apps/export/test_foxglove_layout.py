"""The layout for viewers shows what is there, and its camera sees all of it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from neurosnap.apps.export import foxglove_recording
from neurosnap.apps.export.foxglove_layout import layout
from neurosnap.apps.export.hasse_layout_3d import reach
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of
from tests.support.foxglove_rules import CAMERA, KEYS, PATH, steps
from tests.support.mcap_contents import attached, said, schemas_in


def test_the_layout_shows_what_is_there(log: Path, drawn: Path) -> None:
    files = dict(attached(drawn))
    assert list(files) == ["layout.json"]
    assert files["layout.json"] == foxglove_recording.layout_of(Recording.open(log))
    sensors = options_of(Recording.open(log)).sensors
    whole = json.loads(files["layout.json"])
    panels, schemas = whole["configById"], schemas_in(drawn)
    named = [
        path["value"] for panel in panels.values() for path in panel.get("paths", [])
    ]
    for path in named:
        topic, (field,) = steps(path)
        assert field in schemas[topic]["properties"]
    assert len(named) == 2 * len(sensors) + 4
    assert panels["RosOut!log"]["topicToRender"] in schemas
    assert panels["RawMessages!decisions"]["topicPath"] in schemas
    assert panels["3D!order"]["topics"].keys() <= schemas.keys()


@pytest.mark.parametrize("images", [False, True])
def test_every_panel_of_the_layout_has_its_place(images: bool) -> None:
    whole = json.loads(layout(["door"], 0, images))

    def places(node: Any) -> list[str]:
        if isinstance(node, str):
            return [node]
        assert node.keys() == {"direction", "first", "second", "splitPercentage"}
        assert node["direction"] in ("row", "column")
        assert 0 < node["splitPercentage"] < 100
        return places(node["first"]) + places(node["second"])

    assert sorted(places(whole["layout"])) == sorted(whole["configById"])
    kinds = {name.partition("!")[0] for name in whole["configById"]}
    plain = {"3D", "StateTransitions", "Plot", "RosOut", "RawMessages"}
    assert kinds == (plain | {"Image"} if images else plain)
    assert whole.keys() == {
        "configById",
        "globalVariables",
        "userNodes",
        "playbackConfig",
        "layout",
    }


def test_panels_are_told_what_they_know() -> None:
    panels = json.loads(layout(["door"], 0, images=True))["configById"]
    for name, panel in panels.items():
        assert panel.keys() <= KEYS[name.partition("!")[0]]
        for path in panel.get("paths", []):
            assert path.keys() <= PATH
            assert path["timestampMethod"] in ("receiveTime", "headerStamp")
    assert panels["3D!order"]["cameraState"].keys() == CAMERA


def test_the_camera_sees_the_whole_scene(drawn: Path, log: Path) -> None:
    whole = json.loads(dict(attached(drawn))["layout.json"])
    panel = whole["configById"]["3D!order"]
    camera = panel["cameraState"]
    seen = camera["distance"] * np.sin(np.radians(camera["fovy"] / 2))
    for _, scene in said(drawn, "/graph"):
        (entity,) = scene["entities"]
        assert panel["followTf"] == entity["frame_id"]
        assert panel["transforms"].keys() == {f"frame:{entity['frame_id']}"}
        places = [text["pose"]["position"] for text in entity["texts"]]
        far = max(np.linalg.norm([place[k] for k in "xyz"]) for place in places)
        assert far < seen < 10 * far
        assert camera["near"] < camera["distance"] - far
        assert camera["distance"] + far < camera["far"]


@pytest.mark.parametrize("sensors", [1, 20, 10_000])
def test_the_camera_sees_the_longest_chain(sensors: int) -> None:
    names, far = [f"s{k}" for k in range(sensors)], reach(sensors, sensors - 1)
    camera = json.loads(layout(names, sensors - 1))["configById"]["3D!order"][
        "cameraState"
    ]
    assert camera["distance"] * np.sin(np.radians(camera["fovy"] / 2)) > far
    assert camera["distance"] + far < camera["far"]


def test_a_thousand_sensors_do_not_get_a_thousand_bars() -> None:
    whole = json.loads(layout([f"s{k}" for k in range(1000)], 0))
    assert len(whole["configById"]["StateTransitions!readings"]["paths"]) == 32
