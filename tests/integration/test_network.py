"""A hub listens to the network only with keys; otherwise only on loopback."""

import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.recording.replay.verify import verify
from tests.support.ports import free_port

pytestmark = pytest.mark.zenoh


def call(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.stderr


def run(log: Path, *network: object) -> tuple[int, str]:
    small = ("--set", "places=4", "--ticks", 20)
    return call("run", "neurosnap/Path-v0", *small, "--out", log, *network)


@pytest.mark.slow
def test_a_swarm_with_keys_comes_to_what_one_without_does(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    assert call("init", "keys", keys)[0] == 0
    endpoint = f"tls/127.0.0.1:{free_port()}"
    secured = tmp_path / "secured.mcap"
    code, stderr = run(secured, "--listen", endpoint, "--tls", keys)
    assert code == 0, stderr
    verdict = verify(secured)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 20)


@pytest.mark.slow
def test_a_swarm_listens_on_a_port_of_loopback(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    code, stderr = run(log, "--listen", f"tcp/127.0.0.1:{free_port()}")
    assert code == 0, stderr
    assert verify(log).complete


@pytest.mark.slow
def test_a_port_in_use_ends_it_by_name(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        code, stderr = run(log, "--listen", f"tcp/127.0.0.1:{taken.getsockname()[1]}")
    assert code == 1
    assert stderr.startswith("error: hub: must be able to listen on")
    assert "Address already in use" in " ".join(stderr.split())
    assert ".rs:" not in stderr


@pytest.mark.parametrize(
    ("network", "text"),
    [
        (("--listen", "tcp/0.0.0.0:7447"), "listen: must be tcp/ on loopback"),
        (("--listen", "tcp/192.0.2.1:7447"), "listen: must be tcp/ on loopback"),
        (("--listen", "tls/127.0.0.1:7447"), "listen: must come with keys (--tls)"),
        (("--tls", "keys"), "tls: must come with an endpoint to listen on"),
        (
            ("--listen", "tls/127.0.0.1:7447", "--tls", "nowhere"),
            "nowhere/ca.pem: must be a file that can be read",
        ),
    ],
)
def test_what_would_let_others_in_is_refused(
    network: tuple[str, ...], text: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    code, stderr = run(log, *network)
    assert code == 2
    assert text in " ".join(stderr.split())
    assert not log.exists()
