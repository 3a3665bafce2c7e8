"""Services that wait for a coordinator, and a coordinator that waits for them."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.services import PATH, SMALL, SWARM, ended, going, hub_at

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


@pytest.mark.parametrize(
    "line",
    [
        ("serve", "cells", SWARM, 0),
        ("serve", "recorder", SWARM),
        ("serve", "world", SWARM, PATH),
    ],
    ids=lambda line: line[1],
)
def test_who_waits_for_a_coordinator_says_so_in_the_end(
    line: tuple[object, ...], endpoint: str, tmp_path: Path
) -> None:
    more = ("--out", tmp_path / "log") if line[1] == "recorder" else ()
    with going(*line, *more, "--connect", endpoint, "--patience", 0.2) as waiting:
        said = ended(waiting, 1)
    assert "swarm demo: must have a coordinator within 0.2 s, none came" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "line", [("serve", "recorder", SWARM)], ids=lambda line: line[1]
)
def test_who_waits_ends_when_asked_to(
    line: tuple[object, ...], endpoint: str, tmp_path: Path
) -> None:
    more = ("--out", tmp_path / "log") if line[1] == "recorder" else ()
    with going(*line, *more, "--connect", endpoint) as waiting:
        assert "for swarm demo" in waiting.stderr.readline()
        waiting.send_signal(signal.SIGINT)
        ended(waiting)
    assert not list(tmp_path.iterdir())


def test_a_coordinator_says_who_did_not_come(endpoint: str) -> None:
    at = ("--connect", endpoint)
    run_of = (
        "serve",
        "coordinator",
        PATH,
        *at,
        "--swarm",
        SWARM,
        *SMALL,
        "--patience",
        4,
    )
    with going(*run_of) as coordinator, going("serve", "cells", SWARM, *at, "0-4"):
        said = ended(coordinator, 1)
    rule = "swarm: every part must come up within 4 s, missing:"
    assert f"{rule} cell/5, recorder, world" in said
