"""`neurosnap play` publishes a recording on the network."""

import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.command_line import call, failed, flat, happy, last_json, refused
from tests.support.command_line_files import cut, record_path

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_path(tmp_path_factory.mktemp("log") / "path.mcap")


def test_a_recording_plays_beyond_this_machine_only_where_that_is_asked_for(
    log: Path, tmp_path: Path
) -> None:
    everywhere = ("play", log, "--listen", "tcp/0.0.0.0:0")
    assert "without TLS (--insecure)" in refused(*everywhere)
    keys = ("play", log, "--listen", "tls/localhost:1", "--tls", tmp_path)
    assert str(tmp_path) in refused(*keys)


@pytest.mark.zenoh
def test_the_id_a_stranger_recorded_is_shown_as_it_is(
    tmp_path: Path, endpoint: str
) -> None:
    log = tmp_path / "log.mcap"
    with Writer(log) as writer:
        writer.start({"swarm": "[/red]\x1b"})
        writer.finish({}, {})
    result = call("play", log, "--listen", endpoint)
    assert f"playing on {endpoint} under neurosnap/'[/red]\\x1b'/**" in flat(
        result.stderr
    )


@pytest.fixture
def endpoint() -> Iterator[str]:
    with tempfile.TemporaryDirectory(prefix="ns-") as folder:
        yield f"unixsock-stream/{folder}/hub"


@pytest.mark.zenoh
def test_a_recording_plays(log: Path, endpoint: str) -> None:
    count = sum(1 for _ in Recording.open(log).messages())
    facts = happy("play", log, "--rate", 1e6, "--listen", endpoint)
    assert (facts["ticks"], facts["messages"]) == (30, count)
    facts = happy("play", log, "--rate", 1e6, "--from", 20, "--listen", endpoint)
    assert facts["ticks"] == 11


@pytest.mark.zenoh
def test_a_cut_recording_plays_and_says_so(
    log: Path, tmp_path: Path, endpoint: str
) -> None:
    half = cut(log, tmp_path / "cut")
    result = call("play", half, "--rate", 1e6, "--listen", endpoint, "--format", "json")
    assert result.exit_code == 3
    assert 0 < last_json(result.stdout)["ticks"] < 30


@pytest.mark.zenoh
def test_a_port_in_use_is_an_error(log: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        tcp = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        said = failed("play", log, "--listen", tcp)
    assert f"hub: must be able to listen on {tcp}, got" in said
    assert "Address already in use" in said
    assert ".rs:" not in said
