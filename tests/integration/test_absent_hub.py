"""Commands that connect to a hub that is absent, starts late, or refuses them."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from neurosnap.fabric.zenoh.hub import open_hub
from tests.support.commands import Command
from tests.support.exhaustive import rows
from tests.support.ports import free_port

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]
PATH = "neurosnap/Path-v0"


@pytest.fixture
def endpoint() -> str:
    """Where nobody listens."""
    return f"tcp/127.0.0.1:{free_port()}"


@contextmanager
def waiting(endpoint: str, folder: Path, *line: object) -> Iterator[Command]:
    """A verb that has said that it waits for a hub, and only once."""
    more = ("--connect", endpoint)
    with Command(*line, *more, folder=folder, own_session=True) as process:
        said = ""
        while "waiting for" not in said:
            said = process.stderr.readline()
            assert said, process.wait()
        remedy = f"start one with `neurosnap serve hub --listen {endpoint}`; if"
        assert said.startswith(f"waiting for a hub at {endpoint}: {remedy}")
        yield process


@pytest.mark.parametrize(
    ("line", "number", "code"),
    rows(
        [
            (("run", PATH, "--ticks", 3), signal.SIGINT, 130),
            (("watch", "demo"), signal.SIGHUP, 0),
        ],
        [
            (("serve", "coordinator", PATH, "--swarm", "demo"), signal.SIGTERM, 130),
            (("serve", "recorder", "demo"), signal.SIGINT, 0),
        ],
    ),
    ids=lambda value: value[0] if isinstance(value, tuple) else str(value),
)
def test_who_waits_for_a_hub_says_so_and_ends_at_once(
    line: tuple[object, ...],
    number: signal.Signals,
    code: int,
    endpoint: str,
    tmp_path: Path,
) -> None:
    with waiting(endpoint, tmp_path, *line) as process:
        process.send_signal(number)
        said = process.communicate(timeout=30)
    assert process.returncode == code
    assert "error" not in "".join(said)
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.timeout(120)
def test_a_run_goes_on_once_its_hub_is_there(endpoint: str, tmp_path: Path) -> None:
    line = ("run", PATH, "--ticks", 3, "--set", "places=4", "--out", "a.mcap")
    with waiting(endpoint, tmp_path, *line) as process:
        hub = open_hub([endpoint], 20)
        try:
            _, said = process.communicate(timeout=90)
        finally:
            hub.close()
    # What takes long to interpret, on a slow machine, is compiled.
    told = [line for line in said.splitlines() if not line.startswith("compil")]
    assert (process.returncode, told) == (0, [])
    assert (tmp_path / "a.mcap").is_file()
