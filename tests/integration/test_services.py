"""A swarm each part of which is a service, started apart with no more than its id."""

import shutil
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from neurosnap.fabric.security.roles import Role
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.commands import Command
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.ports import free_port
from tests.support.services import (
    CELLS,
    PATH,
    SMALL,
    SWARM,
    ended,
    facts,
    going,
    hub_at,
    in_one_piece,
    placed,
)

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


SHARES = {"cells": ("0-2,5", "3,4"), "workers": ("1", "0")}
HOW = {"cells": (), "workers": ("--cells", "worker", "--workers", 2)}
ROLES: dict[object, Role] = {
    "recorder": "recorder",
    "cells": "worker",
    "world": "world",
    "coordinator": "coordinator",
}


def host_with(keys: Path, role: Role) -> Path:
    """Return the keys of a host that has one role's, and the watcher's."""
    folder = keys.with_name(f"keys of {role}")
    folder.mkdir(exist_ok=True)
    shutil.copy(keys / "ca.pem", folder)
    for each in (role, "watcher"):
        shutil.copy(keys / f"{each}.pem", folder)
        shutil.copy(keys / f"{each}.key", folder)
    return folder


def play(
    kind: str, log: Path, *at: object, keys: Path | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Make a run of services; return what the coordinator says, and the recorder."""
    with ExitStack() as stack:

        def start(*line: object) -> Command:
            tls = () if keys is None else ("--tls", host_with(keys, ROLES[line[1]]))
            return stack.enter_context(going(*line, *at, *tls))

        recorder = start("serve", "recorder", SWARM, "--out", log, "--format", "json")
        first = start("serve", "cells", SWARM, SHARES[kind][0])
        world = start("serve", "world", SWARM, PATH)
        whole = (
            "--swarm",
            SWARM,
            *SMALL,
            "--ticks",
            40,
            "--format",
            "json",
            *HOW[kind],
        )
        coordinator = start("serve", "coordinator", PATH, *whole)
        late = start("serve", "cells", SWARM, SHARES[kind][1])
        told = facts(ended(coordinator)), facts(ended(recorder))
        for one in (first, world, late):
            ended(one)
    return told


@pytest.mark.parametrize("kind", rows(["cells"], ["workers"]))
def test_services_make_the_run_that_one_process_makes(
    kind: str, endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    came, told = play(kind, log, "--connect", endpoint)
    assert (came["swarm"], came["ticks"], came["cells"]) == (SWARM, 40, CELLS)
    assert (told["complete"], told["served"]) == (True, [SWARM])
    assert told["logs"] == [str(log)]
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 40)
    recording = Recording.open(log)
    cells = [f"cell/{number}" for number in range(CELLS)]
    hosts = cells if kind == "cells" else ["worker/0", "worker/1"]
    assert set(recording.noted().expected) == {"coordinator", "world", *hosts}
    assert recording.swarm == SWARM
    assert placed(log) == {"coordinator", "world", *hosts}
    assert course(log) == course(in_one_piece(40, tmp_path / "inline"))


def test_a_run_leaves_a_worker_to_another_host(endpoint: str, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    whole = ("run", PATH, *at, "--swarm", SWARM, *SMALL, "--ticks", 20, "--out", log)
    with (
        going(*whole, *HOW["workers"], "--elsewhere", "1") as most,
        going("serve", "cells", SWARM, *at, "1") as rest,
    ):
        ended(most)
        ended(rest)
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 20)
    assert placed(log) == {"coordinator", "world", "worker/0", "worker/1"}


def test_a_run_with_all_parts_here_says_nothing_of_places(
    endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    whole = ("run", PATH, "--connect", endpoint, *SMALL, "--ticks", 20, "--out", log)
    with going(*whole) as run_here:
        ended(run_here)
    assert placed(log) == set()


def test_services_with_keys_do_what_their_roles_may(tmp_path: Path) -> None:
    log, keys = tmp_path / "log.mcap", tmp_path / "keys"
    with going("init", "keys", keys) as making:
        ended(making)
    where = f"tls/127.0.0.1:{free_port()}"
    with hub_at(where, "--tls", keys):
        _, told = play("workers", log, "--connect", where, keys=keys)
    assert told["complete"]
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 40)
    assert placed(log) == {"coordinator", "world", "worker/0", "worker/1"}


def test_services_serve_one_swarm_after_the_other(
    endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    lines: tuple[tuple[object, ...], ...] = (
        ("serve", "world", SWARM, PATH),
        ("serve", "cells", SWARM, "0-5"),
        ("serve", "recorder", SWARM, "--out", log, "--format", "json"),
    )
    ways: tuple[tuple[object, ...], ...] = (SMALL, ("--set", "places=7", "--seed", 4))
    with ExitStack() as stack:
        services = [
            stack.enter_context(going(*line, *at, "--restart", "always"))
            for line in lines
        ]
        for way in ways:
            whole = (
                "serve",
                "coordinator",
                PATH,
                *at,
                "--swarm",
                SWARM,
                *way,
                "--ticks",
                10,
            )
            with going(*whole) as coordinator:
                ended(coordinator)
        # The recorder ends the second recording before it ends itself.
        for service in services:
            service.send_signal(signal.SIGINT)
        said = [ended(service) for service in services]
    logs = [log, tmp_path / "log-1.mcap"]
    assert facts(said[-1])["logs"] == [str(each) for each in logs]
    for number, each in enumerate(logs):
        verdict = verify(each)
        assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 10)
        assert Recording.open(each).metadata["seed"] == str(3 + number)
