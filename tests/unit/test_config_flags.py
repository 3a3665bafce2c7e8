"""Flags go before a file that describes a run, where they were given."""

from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from neurosnap.cli.config import FLAGS, described
from neurosnap.config.check import known_keys
from neurosnap.config.faults import dotted
from neurosnap.config.prepare import Prepared
from neurosnap.config.tables import Config
from neurosnap.errors import InvalidValueError
from neurosnap.swarm.options import SnapshotKind

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
    def verb(
        context: typer.Context,
        source: str,
        ticks: int | None = None,
        given: Annotated[list[str] | None, typer.Option("--set")] = None,
        snapshot: SnapshotKind = "empirical",
        threshold: float | None = None,
        out: Path | None = None,
        record: bool = True,
        listen: str = "",
        tls: str = "",
        max_restarts: int = 10,
    ) -> None:
        found.append(described(context))

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


def test_every_flag_stands_for_a_key() -> None:
    assert set(FLAGS.values()) <= set(map(dotted, known_keys(Config)))
    assert len(set(FLAGS.values())) == len(FLAGS)


def test_defaults_of_flags_do_not_go_before_the_file(file: Path) -> None:
    plain = made(file)
    assert (plain.options.ticks, plain.options.snapshot) == (7, "discounted")
    assert plain.options.arguments == {"places": 6}
    assert plain.log is None
    assert plain.network.listen == "tcp/127.0.0.1:0"


def test_given_flags_do(file: Path) -> None:
    flags = ("--ticks", 9, "--threshold", 0.25, "--max-restarts", 0, "--listen", "")
    other = made(file, *flags, "--set", "wait=true", "--set", "places=4")
    assert (other.options.ticks, other.options.threshold) == (9, 0.25)
    assert other.options.decay == 0.5
    assert other.options.arguments == {"places": 4, "wait": True}
    assert (other.supervision.max_restarts, other.network.listen) == (0, "")


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


def test_a_flag_is_called_what_it_is_on_the_command_line(file: Path) -> None:
    with pytest.raises(InvalidValueError) as caught:
        made(file, "--threshold", 0.7, "--ticks", 0)
    assert str(caught.value).splitlines() == [
        "ticks: must be 1 or more, got 0",
        "threshold: must be in (0, 0.25], got 0.7",
    ]


def test_a_source_needs_no_file(file: Path) -> None:
    (file.parent / "here" / "a.csv").write_text("a,b\n0,1\n1,1\n")
    options = made("a.csv", "--out", "b.mcap").options
    assert (options.source, options.ticks, options.snapshot) == (
        "a.csv",
        2,
        "empirical",
    )
    with pytest.raises(InvalidValueError, match=r"^source: must be a file that can be"):
        made("none.csv")
    with pytest.raises(InvalidValueError, match=r"arguments: must not be given for a"):
        made("a.csv", "--set", "x=1")
    with pytest.raises(InvalidValueError, match=r"^set: must be NAME=VALUE, got 'x'$"):
        made("neurosnap/Path-v0", "--set", "x")
    with pytest.raises(
        InvalidValueError, match=r"^out: must be in a folder that exists"
    ):
        made("neurosnap/Path-v0", "--out", "no/a.mcap")
