"""Command-line flags override the values of a run's file."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from neurosnap.apps.cli.run_flags import (
    Given,
    request_of,
    run_options,
    with_run_options,
)
from neurosnap.apps.config.problems import dotted
from neurosnap.apps.config.tables import Config
from neurosnap.apps.config.validate import known_keys
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.request import RunRequest, Supervision
from neurosnap.sources.mqtt.options import MqttBroker
from neurosnap.sources.open import mqtt_options

FILE = """
[source]
kind = "world"
id = "neurosnap/Path-v0"
arguments = { places = 6 }
[run]
ticks = 7
[snapshot]
kind = "discounted"
decay = 0.5
[recording]
record = false
[network]
listen = "tcp/127.0.0.1:0"
"""


def made(*arguments: object) -> RunRequest:
    """Return what a verb with all of the flags makes of arguments."""
    app = typer.Typer()
    found: list[RunRequest] = []

    @app.command()
    @with_run_options(*run_options())
    def verb(context: typer.Context, source: str, given: Given = None) -> None:
        found.append(request_of(context))

    result = CliRunner().invoke(app, list(map(str, arguments)))
    if isinstance(result.exception, InvalidValueError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return found[0]


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    path = tmp_path / "swarm.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


def test_every_key_but_the_source_has_one_flag() -> None:
    keys = [dotted(key) for key in known_keys(Config) if len(key) == 2]
    wanted = [key for key in keys if not key.startswith("source.")]
    assert sorted(option.key for option in run_options().values()) == sorted(wanted)


def test_flags_go_before_the_file_where_they_were_given(file: Path) -> None:
    plain = made(file)
    options = plain.options
    assert (options.ticks, options.snapshot, options.decay) == (7, "discounted", 0.5)
    assert (options.arguments, plain.log) == ({"places": 6}, None)
    assert plain.site.network.listen == "tcp/127.0.0.1:0"

    flags = ("--ticks", 9, "--threshold", 0.25, "--listen", "", "--record")
    keys = ("supervision.max_restarts=0", "wait=true", "places=4")
    more = ("agent.explore=0.5", "recording.split=1MiB", "recording.folder=l")
    other = made(
        file, *flags, *(word for key in keys + more for word in ("--set", key))
    )
    options = other.options
    assert (options.ticks, options.threshold, options.decay) == (9, 0.25, 0.5)
    assert (options.explore, options.split) == (0.5, 2**20)
    assert options.arguments == {"places": 4, "wait": True}
    assert other.supervision == Supervision(max_restarts=0)
    assert other.site.network.listen == ""
    assert other.log is not None
    assert other.log.parent == file.parent / "here" / "l"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("x", "set: must be KEY=VALUE, got 'x'"),
        ("places=\udcff", "set: must be text in UTF-8, got"),
        ("a b=1", "set: must be KEY=VALUE, got 'a b=1'"),
        ("recording.split=10MB", "size: must be like 256MiB, got '10MB'"),
        ("agent.explor=1", "agent.explor: must be a known key (did you mean explore?)"),
        ("agent.explore=2", "agent.explore: must be a number in [0, 1] or 'planned'"),
    ],
)
def test_what_cannot_be_set_is_refused(given: str, text: str) -> None:
    with pytest.raises(InvalidValueError) as caught:
        made("neurosnap/Path-v0", "--set", given)
    assert str(caught.value).startswith(text)


def test_a_flag_that_is_its_default_is_given_all_the_same(file: Path) -> None:
    rule = r"swarm\.toml:10: snapshot\.decay: must"
    with pytest.raises(InvalidValueError, match=rule):
        made(file, "--snapshot", "empirical")


def test_paths_on_the_command_line_are_relative_to_where_it_is_typed(
    file: Path,
) -> None:
    log = made(file, "--record", "--out", "a.mcap").log
    assert log == file.parent / "here" / "a.mcap"
    keys = rf"tls: {file.parent}/here/keys/ca\.pem: must be a file that can be read"
    with pytest.raises(InvalidValueError, match=keys):
        made(file, "--listen", "tls/localhost:1", "--tls", "keys")
    file.write_text(FILE.replace("[network]", '[network]\ntls = "keys"'))
    assert made(file, "--tls", "").site.network.tls == ""  # none at all


HOME = """
[source]
kind = "mqtt"
sensors = [{ name = "door", topic = "door" }]
[source.broker]
host = "mine.test"
port = 1999
tls = true
username = "me"
password_env = "MINE"
[recording]
record = false
"""


def test_another_broker_is_told_nothing_that_is_for_the_one_in_the_file(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("aiomqtt")
    monkeypatch.setenv("MINE", "hush")
    file.write_text(HOME)
    mine = mqtt_options(made(file).options.arguments).broker
    assert (mine.host, mine.password()) == ("mine.test", "hush")
    other = made(file, "--set", 'source.broker={"host": "other.test", "port": 1884}')
    broker = mqtt_options(other.options.arguments).broker
    assert broker == MqttBroker(host="other.test", port=1884)
