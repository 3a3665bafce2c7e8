"""The examples do what their comments say."""

import re
import runpy
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

import numpy as np
import pytest

from neurosnap import DiscountedSnapshot, EmpiricalSnapshot, Sensorium
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.sources.mqtt.payload import Payload, PayloadReader
from neurosnap.sources.open import mqtt_options
from neurosnap.sources.open_readings import open_readings
from tests.support.programs import find, needs

EXAMPLES = Path(__file__).parents[2] / "examples"
UNIT = EXAMPLES / "neurosnap.service"


@needs("systemd-analyze", "systemd")
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    installed = tmp_path / UNIT.name
    text = UNIT.read_text()
    assert text.count("=/opt/neurosnap/bin/neurosnap ") == 1
    # The command is the only thing that need not be on this machine.
    installed.write_text(text.replace("=/opt/neurosnap/bin/neurosnap ", "=/bin/true "))
    done = subprocess.run(
        [str(find("systemd-analyze")), "verify", "--man=no", installed],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_unit_can_write_its_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parsed = ConfigParser(strict=False, interpolation=None)
    parsed.read(UNIT)
    service = parsed["Service"]
    described = Path(service["ExecStart"].split()[-1])
    assert f"cp {described.name} {described.parent}/" in UNIT.read_text()
    state = Path("/var/lib") / service["StateDirectory"]
    assert service["WorkingDirectory"] == str(state)
    for folder in (described.parent, state):
        (tmp_path / folder.relative_to("/")).mkdir(parents=True)
    here = tmp_path / described.relative_to("/")
    shutil.copy(EXAMPLES / described.name, here)
    monkeypatch.chdir(tmp_path / state.relative_to("/"))
    log = prepare(load(here)).log
    assert log is not None
    assert log.resolve().is_relative_to(tmp_path / state.relative_to("/"))


@pytest.mark.parametrize(
    ("name", "topic", "payload", "expected"),
    [
        ("zigbee2mqtt", "zigbee2mqtt/front_door", b'{"contact": false}', True),
        ("zigbee2mqtt", "zigbee2mqtt/lamp", b'{"state": "OFF"}', False),
        ("statestream", "statestream/binary_sensor/front_door/state", b"on", True),
        ("statestream", "statestream/person/anna/state", b"not_home", False),
    ],
)
def test_the_examples_of_a_broker_read_what_is_published_there(
    name: str, topic: str, payload: bytes, expected: bool
) -> None:
    given = prepare(load(EXAMPLES / f"{name}.toml")).options
    sensors = mqtt_options(given.arguments).sensors
    (sensor,) = (each for each in sensors if each.topic == topic)
    assert PayloadReader(sensor).read(Payload(topic, payload)) is expected


def test_a_home_need_not_know_what_is_inside() -> None:
    text = (EXAMPLES / "home.toml").read_text()
    assert not re.search(r"\b(threshold|cells|hold|workers|snapshot)\b", text)
    given = prepare(load(EXAMPLES / "home.toml")).options
    assert (given.cells, given.sharing, given.threshold) == ("worker", 2, "auto")


def test_what_forgets_learns_nothing_before_its_483rd_tick() -> None:
    names = Sensorium(["door", "motion", "warm", "phone"])
    memory = DiscountedSnapshot(names)
    quiet, motion, both = [0, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0]
    for tick in range(1, 484):
        memory.observe((quiet, motion, both, motion)[tick % 4])
        learned = memory.poc_graph().implications(names)
        assert (("door", "motion") in learned) == (tick == 483)


MEANT = """motor power, moving motor, door motor*, heavy scale, pusher heavy,
green power, red power, green red*, green motor, motor green"""


def test_the_readings_are_those_of_their_script() -> None:
    script = runpy.run_path(str(EXAMPLES / "make_readings.py"))
    header, *rows = (EXAMPLES / "readings.csv").read_text().splitlines()
    assert header == ",".join(script["SENSORS"])
    assert rows == [",".join(map(str, row)) for row in script["rows"](1)]


def test_what_the_readings_were_made_by_is_learned_from_them() -> None:
    columns = open_readings(str(EXAMPLES / "readings.csv")).columns
    names = columns.sensorium
    memory = EmpiricalSnapshot(names)
    for bits in np.array([columns.reading(k) for k in range(len(names))]).T[:360]:
        memory.observe(bits)
    graph = memory.poc_graph()
    missed = [
        (one, other)
        for one, other in map(str.split, MEANT.split(","))
        if not graph.leq(names.literal(one), names.literal(other))
    ]
    assert missed == []
