"""A swarm whose parts are separate services that know only its id."""

import re
import shutil
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from neurosnap.fabric.roles import Role
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.command_line import failed, refused
from tests.support.commands import Command
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.recorded_messages import assert_true_run
from tests.support.services import (
    CELLS,
    ENDLESS,
    PATH,
    SMALL,
    SWARM,
    begun,
    ended,
    facts,
    going,
    hub_at,
    in_one_piece,
    up,
)

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """A hub on loopback, for one swarm after the other."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


CONDUCT = ("serve", "coordinator", PATH, "--swarm", SWARM)
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
        given = (*SMALL, "--ticks", 40, "--format", "json", *HOW[kind])
        coordinator = start(*CONDUCT, *given)
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
    assert_true_run(log, ticks=40)
    recording = Recording.open(log)
    cells = [f"cell/{number}" for number in range(CELLS)]
    hosts = cells if kind == "cells" else ["worker/0", "worker/1"]
    assert set(recording.noted().expected) == {"coordinator", "world", *hosts}
    assert recording.swarm == SWARM
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
    assert_true_run(log, ticks=20)


def test_of_two_services_that_wait_with_the_same_worker_one_is_refused(
    endpoint: str, tmp_path: Path
) -> None:
    """One that comes up only once the run has begun ends it instead."""
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    with ExitStack() as stack:
        same = ("serve", "cells", SWARM, "0", *at)
        recorder = ("serve", "recorder", SWARM, "--out", log, "--format", "json", *at)
        whole = (*SMALL, "--ticks", 30, "--cells", "worker", "--workers", 1)
        lines = (same, same, recorder, ("serve", "world", SWARM, PATH, *at))
        *both, records, world = [stack.enter_context(going(*one)) for one in lines]
        for waiting in (*both, records, world):
            waiting.stderr.readline()
        coordinator = stack.enter_context(going(*CONDUCT, *at, *whole))
        _, why = coordinator.communicate(timeout=PATIENCE)
        if coordinator.returncode:
            flat = " ".join(why.split())
            assert re.search("worker/0[^ ]*: must be there once", flat), why
            return
        assert facts(ended(records))["complete"]
        ended(world)
        said = [service.communicate(timeout=PATIENCE)[1] for service in both]
        assert {service.returncode for service in both} == {0, 1}, said
        flat = " ".join("".join(said).split())
        assert re.search("worker/0[^ ]*: must be there once", flat), said
    assert_true_run(log, ticks=30)


def test_services_with_keys_do_what_their_roles_may(tmp_path: Path) -> None:
    log, keys = tmp_path / "log.mcap", tmp_path / "keys"
    with going("init", "keys", keys) as making:
        ended(making)
    where = f"tls/127.0.0.1:{free_port()}"
    with hub_at(where, "--tls", keys):
        _, told = play("workers", log, "--connect", where, keys=keys)
    assert told["complete"]
    assert_true_run(log, ticks=40)


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
        services = [stack.enter_context(going(*line, *at, "--stay")) for line in lines]
        for way in ways:
            with going(*CONDUCT, *at, *way, "--ticks", 10) as coordinator:
                ended(coordinator)
        # The recorder ends the second recording before it ends itself.
        for service in services:
            service.send_signal(signal.SIGINT)
        said = [ended(service) for service in services]
    logs = [log, tmp_path / "log-1.mcap"]
    assert facts(said[-1])["logs"] == [str(each) for each in logs]
    for number, each in enumerate(logs):
        assert_true_run(each, ticks=10)
        assert Recording.open(each).metadata["seed"] == str(3 + number)


# Stopping and waiting -----------------------------------------------------------------


PARTS = ("coordinator", "world", "cells", "recorder")


@pytest.mark.parametrize("who", rows(["recorder"], ["coordinator", "world", "cells"]))
def test_each_of_them_can_be_stopped_in_the_midst(
    who: str, endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    lines: dict[str, tuple[object, ...]] = {
        "coordinator": (PATH, "--swarm", SWARM, *ENDLESS, "--set", "cells.deadline=1"),
        "world": (SWARM, PATH),
        "cells": (SWARM, "0-5"),
        "recorder": (SWARM, "--out", log),
    }
    with ExitStack() as stack:
        parts = {
            part: stack.enter_context(going("serve", part, *line, *at))
            for part, line in lines.items()
        }
        begun(endpoint, 5)
        parts[who].send_signal(signal.SIGINT)
        # Whoever stops the coordinator or the world ends the run in order; who takes
        # cells or the recorder away makes it fail.
        in_order = who in ("coordinator", "world")
        said = ended(parts["coordinator"], 0 if in_order else 1)
        for name in PARTS[1:]:
            if not in_order:  # the others wait for a swarm that continues it
                parts[name].send_signal(signal.SIGINT)
            parts[name].communicate(timeout=PATIENCE)
            if name != "recorder":
                assert parts[name].returncode == 0
    if who == "recorder":
        assert "recorder: must stay until the run ends, is gone" in said
        assert parts["recorder"].returncode == 3
        assert not verify(log).complete
    if in_order:
        assert parts["recorder"].returncode == 0
        assert_true_run(log)
    assert verify(log).ticks >= 4


def test_who_waits_for_a_coordinator_says_so_in_the_end(
    endpoint: str, tmp_path: Path
) -> None:
    out = ("--out", tmp_path / "log.mcap")
    for line in (
        ("cells", SWARM, 0),
        ("recorder", SWARM, *out),
        ("world", SWARM, PATH),
    ):
        said = failed("serve", *line, "--connect", endpoint, "--patience", 0.2)
        assert "swarm demo: must have a coordinator within 0.2 s, none came" in said
    with going("serve", "recorder", SWARM, *out, "--connect", endpoint) as waiting:
        assert "for swarm demo" in waiting.stderr.readline()
        waiting.send_signal(signal.SIGINT)
        ended(waiting)
    assert not list(tmp_path.iterdir())


# Refusing -----------------------------------------------------------------------------

WRONG = {
    "more cells": (
        ("serve", "cells", SWARM, "4-9"),
        2,
        "cells: must be cells of the swarm, 0 to 5, got 9",
    ),
    "another world": (
        ("serve", "world", SWARM, "neurosnap/Cycle-v0"),
        2,
        "source: must be 'neurosnap/Path-v0' here, got 'neurosnap/Cycle-v0'",
    ),
    "a recorder": (("serve", "recorder", SWARM), 2, "got 'recorder'"),
    "the same cell": (
        ("serve", "cells", SWARM, "5"),
        1,
        "cell/5: must be there once, is in demo already",
    ),
    "a coordinator": (
        ("serve", "coordinator", PATH, "--swarm", SWARM),
        1,
        "swarm demo: must have one coordinator, has one already",
    ),
}


def test_who_does_not_fit_is_refused_and_the_run_minds_nothing(
    endpoint: str, tmp_path: Path
) -> None:
    at = ("--connect", endpoint)
    whole = (*SMALL, "--ticks", 20, "--set", "recording.record=false")
    with (
        going(*CONDUCT, *at, *whole) as coordinator,
        going("serve", "cells", SWARM, *at, "0-5") as cells,
    ):
        up(endpoint, "coordinator", *(f"cell/{n}" for n in range(CELLS)))
        for name, (line, code, text) in WRONG.items():
            more = ("--out", tmp_path / "log.mcap") if line[1] == "recorder" else ()
            said = (refused if code == 2 else failed)(*line, *more, *at)
            assert text in said, name
        with going("serve", "world", SWARM, PATH, *at) as world:
            assert "20 in" in ended(coordinator)
            ended(cells)
            ended(world)
    assert not list(tmp_path.iterdir())
