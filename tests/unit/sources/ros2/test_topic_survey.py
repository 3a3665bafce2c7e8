"""What a graph has is listed, and a file that runs on it is written."""

import asyncio
import json
import threading
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.apps.config.sources import Ros2Table
from neurosnap.sources.conditions import is_condition
from neurosnap.sources.message_fields import fields
from neurosnap.sources.ros2.graph import RosGraph, open_session
from neurosnap.sources.ros2.keys_and_tokens import PUBLISHER, Endpoint, GraphNode, Qos
from neurosnap.sources.ros2.node import RosNode
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.ros2.topic_survey import Ros2Survey, ros2_file
from tests.support.patience import PATIENCE

BOOL = "std_msgs/msg/Bool"
TYPES = {
    "/door": BOOL,
    "/rosout": "rcl_interfaces/msg/Log",
    "/mode": "std_msgs/msg/String",
    "/count": "std_msgs/msg/UInt8",
    "/temperature": "std_msgs/msg/Float64",
    "/battery": "sensor_msgs/msg/BatteryState",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/silent": BOOL,
}


def survey() -> Ros2Survey:
    graph = RosGraph()
    for k, (topic, kind) in enumerate(TYPES.items()):
        node = GraphNode(0, "ab", "0", "robot")
        graph.add(Endpoint(node, str(k), PUBLISHER, topic, kind, "RIHS01_0").token)
    made = Ros2Survey(graph, Ros2Options(sensors=("/all",), domain=7))
    for k in range(9):
        twist = {"linear": {"x": k - 4.0}, "angular": {"z": 0.0}}
        said: dict[str, object] = {
            "/door": {"data": True},
            "/mode": {"data": ["auto", "by hand"][k % 2]},
            "/count": {"data": k % 2},
            "/temperature": {"data": (k * 5 % 9) / 2, "variance": 0.0},
            "/battery": {"percentage": 0.5, "present": True, "voltage": 12.0 + k},
            "/scan": {"angle_min": k, "ranges": np.full(640, k)},
            "/cmd_vel": twist,
            "/diagnostics": {"status": {"arm": {"level": 0, "values": {"heat": "1"}}}},
        }
        for topic, message in said.items():
            made.note(topic, message, k / 10)
            made.read(dict(fields(topic, message)), topic)
    return made


def test_each_topic_gives_the_sensors_that_its_type_is_known_for() -> None:
    made = survey()
    found = {
        topic: [each.text for each in made.sensors(topic)] for topic in made.publishers
    }
    ends = range(0, 640, 80)
    assert found == {
        "/battery": [
            "/battery.percentage < 0.2, off > 0.25",
            "/battery.present",
            "/battery heard within 0.3 s",
        ],
        "/cmd_vel": [
            *("/cmd_vel.linear.x > 0.01", "/cmd_vel.linear.x < -0.01"),
            *("/cmd_vel.angular.z > 0.01", "/cmd_vel.angular.z < -0.01"),
            "/cmd_vel heard within 0.3 s",
        ],
        "/count": ["/count.data", "/count heard within 0.3 s"],
        "/diagnostics": [
            "/diagnostics.status.arm.level > 0",
            "/diagnostics heard within 0.3 s",
        ],
        "/door": ["/door.data", "/door heard within 0.3 s"],
        "/mode": [
            *("/mode.data = auto", "/mode.data = by hand"),
            "/mode heard within 0.3 s",
        ],
        "/scan": [
            *(f"min(/scan.ranges[{at}:{at + 80}]) < 0.5, off > 0.6" for at in ends),
            "/scan heard within 0.3 s",
        ],
        "/silent": [],
        "/temperature": ["/temperature.data", "/temperature heard within 0.3 s"],
    }


def test_the_file_is_one_that_runs() -> None:
    made = survey()
    table = tomllib.loads(ros2_file(made))["source"]
    options = msgspec.convert(table, Ros2Table)
    assert options.domain == 7
    every = [each.text for topic in made.publishers for each in made.sensors(topic)]
    assert list(options.sensors) == every
    assert options.plain == (
        *("/battery.present", "/count.data", "/door.data", "/temperature.data"),
    )
    assert all(is_condition(each) for each in every if each not in options.plain)


@pytest.mark.zenoh
def test_a_graph_is_listed_and_a_file_written(
    router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    came = threading.Event()
    read = Ros2Survey.read

    def heard(survey: Ros2Survey, *said: Any) -> Any:
        found = read(survey, *said)
        came.set()
        return found

    async def until_heard(*_: object, seconds: float) -> None:
        assert seconds == 3600
        await asyncio.to_thread(came.wait, PATIENCE)

    monkeypatch.setattr(Ros2Survey, "read", heard)
    monkeypatch.setattr("neurosnap.apps.cli.ros2.wait_any", until_heard)
    out = tmp_path / "robot.toml"
    with open_session(router) as session:
        node = RosNode(session, "robot", domain=99)
        door = node.publisher("/door", BOOL, Qos(latched=True, depth=1))
        door.publish(node.types[BOOL](True))
        command = ["ros2", "discover", "--router", router, "--domain", "99"]
        more = ["--seconds", "3600", "--format", "json", "--out", str(out)]
        said = CliRunner().invoke(app, [*command, *more])
        node.close()
    assert said.exit_code == 0, said.output
    facts = json.loads(said.stdout.splitlines()[-1])
    assert facts["nodes"] == ["/robot"]
    assert facts["topics"] == [
        {
            "topic": "/door",
            "type": BOOL,
            "messages": 1,
            "period": 0.0,
            "publishers": ["/robot"],
            "sensors": ["/door.data"],
        }
    ]
    options = msgspec.convert(tomllib.loads(out.read_text())["source"], Ros2Table)
    assert (options.router, options.sensors) == (router, ("/door.data",))


@pytest.mark.zenoh
def test_a_graph_without_topics(router: str) -> None:
    command = ["ros2", "discover", "--router", router, "--domain", "98"]
    said = CliRunner().invoke(app, command)
    assert (said.exit_code, said.stdout) == (
        0,
        "nodes: none\nno topics are published\n",
    )


BURSTS = [burst + more for burst in range(20) for more in (0.0, 0.001, 0.002)]
LATE = [k / 50 + 9 * (k > 10) for k in range(20)]


@pytest.mark.parametrize(
    ("times", "within", "period"),
    [(BURSTS, "3 s", 19.002 / 59), (LATE, "0.1 s", 9.38 / 19)],
)
def test_a_topic_is_heard_between_bursts_and_one_that_is_late_is_not(
    times: list[float], within: str, period: float
) -> None:
    made = survey()
    for at in times:
        made.note("/silent", {"data": True}, at)
    made.read({"/silent.data": True}, "/silent")
    assert made.period("/silent") == pytest.approx(period)
    assert [each.text for each in made.sensors("/silent")] == [
        *("/silent.data", f"/silent heard within {within}")
    ]
