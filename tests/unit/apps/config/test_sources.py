"""TOML tables that describe live sources."""

import sys
from pathlib import Path

import pytest

from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.config.problems import ConfigError
from neurosnap.protocol.run_options import FOREVER, RunOptions
from neurosnap.sources.open import mqtt_options, open_live

MQTT = """
[source]
kind = "mqtt"
stale_after = 60
sensors = [
  { name = "door", topic = "home/door" },
  { name = "warm", topic = "home/t", field = "c", when = "> 21, off < 20" },
]
actions = [{ name = "light", topic = "home/light/set", payload = "1" }]
[source.broker]
host = "broker.test"
username = "me"
password_file = "secret"
[source.tick]
interval = 0.5
[source.publish]
prefix = "memory"
"""


def options(folder: Path, text: str) -> RunOptions:
    path = folder / "swarm.toml"
    path.write_text(f"{text}\n[recording]\nrecord = false\n", encoding="utf-8")
    return prepare(load(path)).options


def test_topics_are_sensors_and_files_are_beside_the_description(
    tmp_path: Path,
) -> None:
    (tmp_path / "secret").write_text("hush\n", encoding="utf-8")
    made = options(tmp_path, MQTT)
    assert made.body.own == ("door", "warm")
    assert made.body.actions == ("none", "light")
    assert made.ticks == FOREVER
    given = mqtt_options(made.arguments)
    assert given.broker.password_file == str(tmp_path / "secret")
    assert given.broker.password() == "hush"
    assert "hush" not in repr(made)
    assert given.sensors[1].when == "> 21, off < 20"
    source = open_live(made.source, made.arguments)
    assert (source.sensors, source.live) == (("door", "warm"), True)
    source.close()


@pytest.mark.parametrize(
    ("mode", "warned"), [(0o600, 0), (0o640, 0), (0o644, 1), (0o602, 1)]
)
def test_a_password_that_everybody_may_read_is_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, mode: int, warned: int
) -> None:
    secret = tmp_path / "secret"
    secret.write_text("hush\n", encoding="utf-8")
    secret.chmod(mode)
    options(tmp_path, MQTT)
    said = [record.getMessage() for record in caplog.records]
    assert said == warned * [
        f"{secret}: holds a password and must not be open to everybody:"
        f" chmod o= {secret}"
    ]


@pytest.mark.parametrize("kind", ["stdin", "zenoh"])
def test_readings_have_names_and_a_pace(tmp_path: Path, kind: str) -> None:
    made = options(
        tmp_path,
        f'[source]\nkind = "{kind}"\nsensors = ["door", "2"]\nstale_after = 9.5\n',
    )
    assert made.body.own == ("door", "2")
    source = open_live(made.source, made.arguments)
    assert source.sensors == ("door", "2")
    source.close()


def test_packages_that_are_missing_are_missed_by_the_kind_of_the_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "neurosnap.sources.mqtt.mqtt_source", None)
    with pytest.raises(ConfigError) as refused:
        options(tmp_path, MQTT)
    said = str(refused.value).removeprefix(f"{tmp_path}/")
    assert said.startswith("swarm.toml:3: source.kind: must have ")
    assert said.endswith("pip install 'neurosnap-uma[mqtt]'`), got 'no such package'")
