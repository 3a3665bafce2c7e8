"""A source named in a recording is opened only if the user allows it."""

import asyncio
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

import neurosnap
from neurosnap.agent.body import Body
from neurosnap.apps.cli import app
from neurosnap.apps.config.load import named_source
from neurosnap.apps.config.problems import ConfigError
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.coordinator_process import RunDescription
from neurosnap.runtime.parts.recorder_process import describe
from neurosnap.runtime.recorded_source import reopened
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.run_with_restarts import resumed, run
from neurosnap.sources.open import MQTT, STDIN, ZENOH, mqtt_options
from tests.support.restart_runs import options_of
from tests.support.run_options import options_for

BROKER = {
    "host": "10.0.0.1",
    "username": "me",
    "password_env": "AWS_SECRET_ACCESS_KEY",
    "tls": True,
    "ca_file": "theirs.pem",
}
HOME = """
[source]
kind = "mqtt"
sensors = [{ name = "a", topic = "home/a" }]
[source.broker]
host = "mine.local"
username = "me"
password_file = "secret"
"""
WORLD = """
import gymnasium

class World(gymnasium.Env):
    observation_space = gymnasium.spaces.MultiBinary(2)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, size=1):
        pass

gymnasium.register("test/Evil-v0", World, disable_env_checker=True)
"""


def of_broker(**broker: object) -> dict[str, Any]:
    """Return the arguments of a source at a broker."""
    sensors = [{"name": "a", "topic": "home/a"}]
    said = {"kind": "mqtt", "broker": {**BROKER, **broker}, "sensors": sensors}
    return {"options": msgspec.json.encode(said).decode()}


def naming(source: str, arguments: Mapping[str, Any] = {}) -> RunOptions:
    body = Body(own=("a",), orders=(0,))
    return RunOptions(source=source, arguments=dict(arguments), body=body)


def recorded(log: Path, options: RunOptions) -> Path:
    """Write the recording of a walk that says it was another run, as a stranger may."""
    walked = options_of(5)
    other = log.with_name("walk.mcap")
    asyncio.run(run(RunRequest(walked, other), asyncio.Event()))
    walk = Recording.open(other)
    claimed = msgspec.structs.replace(
        walked, source=options.source, arguments=options.arguments
    )
    facts = dict(walk.metadata)
    facts["options"] = msgspec.json.encode(claimed).decode()
    with Writer(log) as writer:
        writer.start(facts)
        for each in walk.messages():
            writer.add(each.delivery, each.log_time)
        writer.finish({}, walk.noted().expected)
    return log


@pytest.fixture
def evil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the name of a world in a module of the working folder."""
    (tmp_path / "evil_module.py").write_text(WORLD)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "evil_module", raising=False)
    return "evil_module:test/Evil-v0"


@pytest.mark.parametrize(
    ("options", "effect"),
    [
        (naming("evil:E-v0", {"a": 1}), "run the world 'evil:E-v0' with {'a': 1}"),
        (naming("CartPole-v1"), "import and run the world 'CartPole-v1'"),
        (naming("neurosnap/evil:E-v0"), "run the world 'neurosnap/evil:E-v0'"),
        (naming("/etc/rows.csv"), "read the file '/etc/rows.csv'"),
        (naming("neurosnap/rows.csv"), "read the file 'neurosnap/rows.csv'"),
        (naming("neurosnap/there"), "read the file 'neurosnap/there'"),
        (naming("neurosnap/There-v0"), "read the file 'neurosnap/There-v0'"),
        (naming("x" * 5000), "import and run the world 'xxx"),
        (naming("\x1b[2J"), "run the world '\\x1b[2J'"),
        (naming(ZENOH, {"sensors": "a"}), "take readings from Zenoh"),
        (
            naming(MQTT, of_broker()),
            "connect to the broker '10.0.0.1:8883' (username 'me', ca_file"
            " 'theirs.pem')",
        ),
    ],
)
def test_nothing_is_opened_without_a_word(
    options: RunOptions, effect: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "neurosnap").mkdir()
    for name in ("there", "There-v0"):
        (tmp_path / "neurosnap" / name).write_text("a\n1\n")
    monkeypatch.chdir(tmp_path)
    opened: list[object] = []
    place = "neurosnap.runtime.recorded_source.open_source"
    monkeypatch.setattr(place, lambda *given: opened.append(given))
    with pytest.raises(InvalidValueError) as refused:
        reopened(options, trusts=False)
    said = str(refused.value)
    assert said.startswith("source: must be named again (a world, a file, or the TOML")
    assert "or come with --trust-source" in said
    assert effect in said
    assert opened == []


def test_worlds_of_ours_and_standard_input_are_opened_as_recorded() -> None:
    walk = options_of(5)
    assert reopened(walk, trusts=False) == (walk, None)
    lines = naming(STDIN, {"sensors": "a"})
    assert reopened(lines, trusts=False) == (lines, None)


def test_a_file_may_be_named_where_it_is_now(tmp_path: Path) -> None:
    there, here = tmp_path / "there" / "rows.csv", tmp_path / "rows.csv"
    here.write_text("a\n1\n0\n")
    options = naming(str(there))
    moved, length = reopened(options, named_source(str(here)))
    assert (moved.source, length) == (str(here), 2)
    other = tmp_path / "other.csv"
    other.write_text("a\n1\n0\n")
    with pytest.raises(InvalidValueError, match=r"^source: must be '.*rows.csv' here"):
        reopened(options, named_source(str(other)))
    here.write_text("b\n1\n0\n")
    with pytest.raises(InvalidValueError, match=r"must have the sensors and actions"):
        reopened(options, named_source(str(here)))


def test_a_world_must_be_named_with_its_arguments(evil: str, tmp_path: Path) -> None:
    file = tmp_path / "run.toml"
    text = f'[source]\nkind = "world"\nid = "{evil}"\n'
    file.write_text(f"{text}arguments = {{ size = 3 }}\n")
    assert "evil_module" not in sys.modules
    plain = options_for(evil, 0)
    options = msgspec.structs.replace(plain, arguments={"size": 3})
    assert reopened(options, named_source(str(file)))[0] == options
    file.write_text(text)
    rule = r"^arguments: must be named here, too, as \{'size': 3\}, got \{\}"
    with pytest.raises(InvalidValueError, match=rule):
        reopened(options, named_source(str(file)))
    file.write_text(f"{text}more = 1\n")
    with pytest.raises(ConfigError, match="more"):
        named_source(str(file))


def test_a_broker_is_the_one_that_is_named(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("hush\n")
    (tmp_path / "home.toml").write_text(HOME)
    options = naming(MQTT, of_broker(tls=False, ca_file=None))
    found, _ = reopened(options, named_source(str(tmp_path / "home.toml")))
    broker = mqtt_options(found.arguments).broker
    assert (broker.host, broker.password()) == ("mine.local", "hush")


def test_no_place_of_a_secret_is_recorded_or_told() -> None:
    for place in ({"password_env": "HUSH"}, {"password_file": "/HUSH"}):
        options = naming(MQTT, of_broker(**{"password_env": None, **place}))
        facts = describe(options)
        for said in (*facts.values(), RunDescription(options=options).to_bytes()):
            assert "HUSH" not in str(said)
        kept = msgspec.json.decode(facts["options"], type=RunOptions)
        broker = mqtt_options(kept.arguments).broker
        assert (broker.host, broker.username) == ("10.0.0.1", "me")


def test_a_restart_goes_on_with_the_secrets_that_are_not_recorded(
    tmp_path: Path,
) -> None:
    claimed = of_broker(tls=False, ca_file=None)
    options = msgspec.structs.replace(
        options_of(5), source=MQTT, arguments=claimed, ticks=6
    )
    log = tmp_path / "run.mcap"
    stored = msgspec.json.decode(describe(options)["options"], type=RunOptions)
    recorded(log, stored)
    options = msgspec.structs.replace(options, ticks=stored.ticks - 1)
    found = RestartFiles(log).furthest(options)
    assert found is not None
    assert found.tick == 4


# Through the ways in ------------------------------------------------------------------


def test_resume_imports_nothing_that_was_not_named(evil: str, tmp_path: Path) -> None:
    log = recorded(tmp_path / "given.mcap", naming(evil))
    line = ["resume", str(log), "--out", str(tmp_path / "new.mcap")]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 2
    assert f"import and run the world '{evil}' with {{}}" in result.stderr
    with pytest.raises(InvalidValueError, match="--trust-source"):
        neurosnap.Recording(log).resume(tmp_path / "new.mcap")
    with pytest.raises(InvalidValueError, match="--trust-source"):
        resumed(log)
    assert "evil_module" not in sys.modules
    for more in (["--trust-source"], [evil]):
        result = CliRunner().invoke(app, [*line[:2], *more, *line[2:]])
        assert result.exit_code == 2
        assert "must have the sensors and actions of the run" in result.stderr
        del sys.modules["evil_module"]  # which was imported
    assert not (tmp_path / "new.mcap").exists()
