"""Flags go before a file that describes a run, where they were given."""

import re
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from neurosnap.apps.cli.broker import brokered
from neurosnap.apps.cli.options import (
    Given,
    described,
    run_options,
    with_run_options,
)
from neurosnap.apps.config.prepare import Prepared
from neurosnap.apps.config.problems import dotted
from neurosnap.apps.config.tables import Config
from neurosnap.apps.config.validate import known_keys
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.request import Supervision
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


def made(*arguments: object) -> Prepared:
    """Return what a verb with some of the flags makes of arguments."""
    app = typer.Typer()
    found: list[Prepared] = []

    @app.command()
    @with_run_options(*run_options())
    def verb(
        context: typer.Context, source: str, given: Given = None, broker: str = ""
    ) -> None:
        with brokered(broker, source) as before:
            found.append(described(context, before))

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


def test_every_key_but_the_source_and_tables_in_lists_has_one_flag() -> None:
    keys = [dotted(key) for key in known_keys(Config) if len(key) == 2]
    wanted = [key for key in keys if not key.startswith(("source.", "agent.births"))]
    assert sorted(option.key for option in run_options().values()) == sorted(wanted)


def test_a_verb_has_the_options_that_are_named_and_its_own() -> None:
    app = typer.Typer()

    @app.command()
    @with_run_options("tls", "seed")
    def verb(context: typer.Context, source: str, ticks: int = 5) -> None:
        """Do nothing."""

    command = typer.main.get_command(app)
    names = [str(param.name) for param in command.params]
    assert names[:4] == ["source", "seed", "tls", "ticks"]
    assert command.params[3].default == 5


def test_defaults_of_flags_do_not_go_before_the_file(file: Path) -> None:
    plain = made(file)
    assert (plain.options.ticks, plain.options.snapshot) == (7, "discounted")
    assert plain.options.arguments == {"places": 6}
    assert plain.log is None
    assert plain.network.listen == "tcp/127.0.0.1:0"


def test_given_flags_do(file: Path) -> None:
    flags = (
        "--ticks",
        9,
        "--threshold",
        0.25,
        "--set",
        "supervision.max_restarts=0",
        "--listen",
        "",
    )
    other = made(file, *flags, "--set", "wait=true", "--set", "places=4")
    assert (other.options.ticks, other.options.threshold) == (9, 0.25)
    assert other.options.decay == 0.5
    assert other.options.arguments == {"places": 4, "wait": True}
    assert other.supervision == Supervision(max_restarts=0)
    assert other.network.listen == ""


def test_every_key_can_be_set(file: Path) -> None:
    keys = ("agent.explore=0.5", "recording.split=1MiB", "recording.record=true")
    line = [word for key in keys for word in ("--set", key)]
    other = made(file, *line, "--set", "agent.births=[]", "--set", "recording.folder=l")
    assert (other.options.explore, other.options.split) == (0.5, 2**20)
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
        (
            "agent.explore=2",
            "agent.explore: must be a number in [0, 1] or 'planned', got",
        ),
    ],
)
def test_what_cannot_be_set_is_refused(given: str, text: str) -> None:
    with pytest.raises(InvalidValueError) as caught:
        made("neurosnap/Path-v0", "--set", given)
    assert str(caught.value).startswith(text)


def test_a_flag_that_is_its_default_is_given_all_the_same(file: Path) -> None:
    with pytest.raises(
        InvalidValueError, match=r"swarm\.toml:10: snapshot\.decay: must"
    ):
        made(file, "--snapshot", "empirical")
    assert made(file, "--record").log is not None


def test_paths_on_the_command_line_are_relative_to_where_it_is_typed(
    file: Path,
) -> None:
    log = made(file, "--record", "--out", "a.mcap").log
    assert log == file.parent / "here" / "a.mcap"
    keys = rf"tls: {file.parent}/here/keys/ca\.pem: must be a file that can be read"
    with pytest.raises(InvalidValueError, match=keys):
        made(file, "--listen", "tls/localhost:1", "--tls", "keys")


def test_no_path_at_all_is_none(file: Path) -> None:
    assert made(file, "--tls", "").network.tls == ""
    assert (
        made(
            "neurosnap/Path-v0", "--set", "recording.record=false", "--tls", ""
        ).network.tls
        == ""
    )
    text = file.read_text().replace("[network]", '[network]\ntls = "keys"')
    file.write_text(text)
    assert made(file, "--tls", "").network.tls == ""


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


@pytest.mark.parametrize(
    ("given", "broker"),
    [
        ("other.test", MqttBroker(host="other.test")),
        ("other.test:1884", MqttBroker(host="other.test", port=1884)),
    ],
)
def test_another_broker_is_told_nothing_that_is_for_the_one_in_the_file(
    file: Path, given: str, broker: MqttBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("aiomqtt")
    monkeypatch.setenv("MINE", "hush")
    file.write_text(HOME)
    mine = mqtt_options(made(file).options.arguments).broker
    assert (mine.host, mine.password()) == ("mine.test", "hush")
    other = mqtt_options(made(file, "--broker", given).options.arguments)
    assert other.broker == broker


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("h:99999", "port: must be a whole number in [1, 655"),
        *(
            (given, "must be embedded, HOST or HOST:PORT, got ")
            for given in ("::1", "[::1]:1883", ":1883", "h:", "h:x", "a:b:1")
        ),
    ],
)
def test_what_is_no_host_and_port_is_refused(file: Path, given: str, said: str) -> None:
    file.write_text(HOME)
    with pytest.raises(InvalidValueError, match=f"^{re.escape(f'broker: {said}')}"):
        made(file, "--broker", given)


def test_a_flag_is_called_what_it_is_on_the_command_line(file: Path) -> None:
    with pytest.raises(InvalidValueError) as caught:
        made(file, "--threshold", 0.7, "--ticks", 0)
    assert str(caught.value).splitlines() == [
        "ticks: must be a whole number, 1 or more, got 0",
        "threshold: must be a number in (0, 0.25] or 'auto', got 0.7",
    ]


def test_a_source_needs_no_file(file: Path) -> None:
    (file.parent / "here" / "a.csv").write_text("a,b\n0,1\n1,1\n")
    options = made("a.csv", "--out", "b.mcap").options
    assert (options.source, options.ticks, options.snapshot) == (
        "a.csv",
        2,
        "empirical",
    )
