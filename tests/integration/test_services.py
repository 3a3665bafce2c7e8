"""A swarm each part of which is a service, started apart with no more than its id."""

import asyncio
import json
import re
import shutil
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from neurosnap import wire
from neurosnap.apps.viewer.members import members
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.fabric.location import Place
from neurosnap.fabric.security.roles import Role
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.read.split_files import part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.run import run
from neurosnap.sources.open import Argument, open_source
from tests.support.commands import Command
from tests.support.course import course
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

PATH = "neurosnap/Path-v0"
SWARM = "demo"
SMALL = ("--set", "places=7", "--seed", 3)
ENDLESS = (*SMALL, "--ticks", 1_000_000)
CELLS = 6


going = Command
"""A verb in a process of its own, which does not outlive the block."""


def ended(process: Command, code: int = 0) -> str:
    """Wait for the end and return what was said, in one line."""
    out, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == code, said + out
    return " ".join((said + out).split())


@contextmanager
def hub_at(where: str, *more: object) -> Iterator[None]:
    with going("hub", "--listen", where, *more) as hub:
        assert "listening on" in hub.stderr.readline()
        yield
        hub.send_signal(signal.SIGINT)
        ended(hub)


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


def up(endpoint: str, *parts: str, swarm: str = SWARM) -> None:
    """Return once all of `parts` are there."""

    async def wait() -> None:
        missing, there = set(parts), asyncio.Event()

        def change(who: str, alive: bool) -> None:
            missing.difference_update({who} if alive else ())
            if not missing:
                there.set()

        async with ZenohFabric("watcher", swarm, endpoint) as fabric:
            await fabric.watch(change)
            async with asyncio.timeout(PATIENCE):
                await there.wait()

    asyncio.run(wait())


def begun(endpoint: str, tick: int, swarm: str = SWARM) -> None:
    """Return once a swarm has come so far."""

    async def wait() -> None:
        far = asyncio.Event()

        def handle(burst: list[wire.Delivery]) -> None:
            for each in burst:
                state = wire.decode(each.key, each.payload)
                if isinstance(state, wire.State) and state.tick >= tick:
                    far.set()

        async with ZenohFabric("watcher", swarm, endpoint) as fabric:
            await fabric.subscribe(("state",), handle)
            async with asyncio.timeout(PATIENCE):
                await far.wait()

    asyncio.run(wait())


def facts(said: str) -> dict[str, Any]:
    found = re.search(r"\{.*\}", said)
    assert found is not None, said
    told: dict[str, Any] = json.loads(found[0])
    return told


def placed(log: Path) -> set[str]:
    """Return whose machine is recorded, and shown: for all of those, it is this one."""
    places = Recording.open(log).places
    assert len({place.pid for place in places.values()}) == len(places)
    shown = {part.who: part.host for part in members(RunView(log)).cells if part.host}
    assert shown == {
        who: f"host {Place.here().host}, process {place.pid}"
        for who, place in places.items()
    }
    return set(places)


def in_one_piece(ticks: int, log: Path) -> Path:
    """Record the same run in one process."""
    arguments: dict[str, Argument] = {"places": 7}
    source = open_source(PATH, 3, arguments)
    source.close()
    options = RunOptions(
        source=PATH,
        arguments=arguments,
        body=body_of(source, "walker"),
        ticks=ticks,
        seed=3,
        cells="inline",
    )
    asyncio.run(run(options, log, asyncio.Event()))
    return log


SHARES = {
    "cells": (("--cells", "0-2,5"), ("--cells", "3,4")),
    "workers": (("--workers", "1"), ("--workers", "0")),
}
HOW = {"cells": (), "workers": ("--cells", "worker", "--workers", 2)}


ROLES: dict[object, Role] = {
    "record": "recorder",
    "join": "worker",
    "world": "world",
    "coordinate": "coordinator",
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
            tls = () if keys is None else ("--tls", host_with(keys, ROLES[line[0]]))
            return stack.enter_context(going(*line, *at, *tls))

        recorder = start("record", SWARM, "--out", log, "--json")
        first = start("join", SWARM, *SHARES[kind][0])
        world = start("world", SWARM, PATH)
        whole = ("--swarm", SWARM, *SMALL, "--ticks", 40, "--json", *HOW[kind])
        coordinator = start("coordinate", PATH, *whole)
        late = start("join", SWARM, *SHARES[kind][1])
        told = facts(ended(coordinator)), facts(ended(recorder))
        for one in (first, world, late):
            ended(one)
    return told


@pytest.mark.parametrize("kind", SHARES)
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


def stopped_at(
    endpoint: str, log: Path, what: tuple[object, ...] = (PATH, *ENDLESS), tick: int = 5
) -> int:
    """Make a run of services, stop it after `tick`; return its last whole one."""
    at = ("--connect", endpoint)
    lines: tuple[tuple[object, ...], ...] = (
        ("record", SWARM, "--out", log),
        ("join", SWARM, "--cells", "0-5"),
        ("world", SWARM, PATH),
        ("coordinate", *what, "--swarm", SWARM),
    )
    with ExitStack() as stack:
        services = [stack.enter_context(going(*line, *at)) for line in lines]
        begun(endpoint, tick)
        services[-1].send_signal(signal.SIGINT)
        for service in services:
            ended(service)
    return verify(log).ticks


def test_services_go_on_with_a_run_that_was_stopped(
    endpoint: str, tmp_path: Path
) -> None:
    log, new = tmp_path / "log.mcap", tmp_path / "new.mcap"
    tick = stopped_at(endpoint, log)
    content, at = log.read_bytes(), ("--connect", endpoint)
    lines: tuple[tuple[object, ...], ...] = (
        ("record", SWARM, "--out", new, "--resume", log, "--json"),
        ("join", SWARM, "--cells", "0-5"),
        ("world", SWARM, PATH),
    )
    again = ("coordinate", PATH, "--swarm", SWARM, *SMALL, "--ticks", tick + 20)
    with ExitStack() as stack:
        others = [stack.enter_context(going(*line, *at)) for line in lines]
        with going(*again, "--resume", log, "--json", *at) as coordinator:
            came = facts(ended(coordinator))
        recorder, *_ = [ended(one) for one in others]
    assert (came["ticks"], came["resumed_at"]) == (tick + 20, tick)
    assert facts(recorder)["complete"]
    assert log.read_bytes() == content
    cells = [f"cell/{number}" for number in range(CELLS)]
    assert placed(new) == placed(log) == {"coordinator", "world", *cells}
    assert Recording.open(new).places != Recording.open(log).places
    verdict = verify(new)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, tick + 20)
    assert course(new) == course(in_one_piece(tick + 20, tmp_path / "inline"))


SPLIT = """
[source]
kind = "world"
id = "neurosnap/Path-v0"
arguments = { places = 7 }

[recording]
keyframe_every = 50
split = 65536
"""


def test_a_recorder_names_the_file_in_which_a_split_run_goes_on(
    endpoint: str, tmp_path: Path
) -> None:
    described, log, new = (tmp_path / name for name in ("s.toml", "a.mcap", "b.mcap"))
    described.write_text(SPLIT)
    tick = stopped_at(endpoint, log, (described, "--ticks", 1_000_000), 600)
    at, again = ("--connect", endpoint), ("--resume", log)
    lines: tuple[tuple[object, ...], ...] = (
        ("record", SWARM, "--out", new, *again, "--json"),
        ("join", SWARM, "--cells", "0-5"),
        ("world", SWARM, PATH),
        ("coordinate", described, "--swarm", SWARM, "--ticks", tick + 5, *again),
    )
    with ExitStack() as stack:
        going_on = [stack.enter_context(going(*line, *at)) for line in lines]
        recorder, *_ = [ended(one) for one in going_on]
    written = log.with_name(f"b_{len(part_paths(log)) - 1:04d}.mcap")
    assert len(part_paths(log)) > 1
    assert facts(recorder)["logs"] == [str(written)]
    verdict = verify(written)
    assert (verdict.same, verdict.complete) == (True, True)


def test_only_the_same_run_goes_on_and_if_there_is_more_to_come(
    endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    tick = stopped_at(endpoint, log)
    whole = ("coordinate", PATH, "--swarm", SWARM, "--connect", endpoint)
    ways: tuple[tuple[tuple[object, ...], str], ...] = (
        (("--set", "places=7", "--seed", 4), "resume: must be a recording of the run"),
        ((*SMALL, "--ticks", tick), f"ticks: must be more than the {tick} there are"),
    )
    for described, text in ways:
        with going(*whole, *described, "--resume", log) as coordinator:
            assert text in ended(coordinator, 2)


@pytest.mark.parametrize("new", [True, False], ids=["new run", "another recording"])
def test_a_recorder_takes_over_nothing_but_what_the_run_goes_on_from(
    new: bool, endpoint: str, tmp_path: Path
) -> None:
    log, at = tmp_path / "log.mcap", ("--connect", endpoint)
    stopped_at(endpoint, log)
    other = in_one_piece(40, tmp_path / "other.mcap")
    whole = ("coordinate", PATH, "--swarm", SWARM, *ENDLESS, *at)
    more: tuple[object, ...] = () if new else ("--resume", log)
    rule = "go with a resumed run" if new else "be the recording that the"
    with going(*whole, *more) as coordinator:
        up(endpoint, "coordinator")
        line = ("record", SWARM, "--out", tmp_path / "new", "--resume", other, *at)
        with going(*line) as recorder:
            assert f"resume: must {rule}" in ended(recorder, 2)
        coordinator.send_signal(signal.SIGINT)
        coordinator.communicate(timeout=PATIENCE)
    assert not (tmp_path / "new").exists()


def test_a_run_leaves_a_worker_to_another_host(endpoint: str, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    whole = ("run", PATH, *at, "--swarm", SWARM, *SMALL, "--ticks", 20, "--out", log)
    with (
        going(*whole, *HOW["workers"], "--elsewhere", "1") as most,
        going("join", SWARM, *at, "--workers", "1") as rest,
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
    with going("keys", keys) as making:
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
        ("world", SWARM, PATH),
        ("join", SWARM, "--cells", "0-5"),
        ("record", SWARM, "--out", log, "--json"),
    )
    ways: tuple[tuple[object, ...], ...] = (SMALL, ("--set", "places=7", "--seed", 4))
    with ExitStack() as stack:
        services = [
            stack.enter_context(going(*line, *at, "--restart", "always"))
            for line in lines
        ]
        for way in ways:
            whole = ("coordinate", PATH, *at, "--swarm", SWARM, *way, "--ticks", 10)
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


@pytest.mark.parametrize(
    "line",
    [("join", SWARM, "--cells", 0), ("record", SWARM), ("world", SWARM, PATH)],
    ids=lambda line: line[0],
)
def test_who_waits_for_a_coordinator_says_so_in_the_end(
    line: tuple[object, ...], endpoint: str, tmp_path: Path
) -> None:
    more = ("--out", tmp_path / "log") if line[0] == "record" else ()
    with going(*line, *more, "--connect", endpoint, "--patience", 0.2) as waiting:
        said = ended(waiting, 1)
    assert "swarm demo: must have a coordinator within 0.2 s, none came" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "line",
    [("join", SWARM, "--cells", 0), ("record", SWARM), ("world", SWARM, PATH)],
    ids=lambda line: line[0],
)
def test_who_waits_ends_when_asked_to(
    line: tuple[object, ...], endpoint: str, tmp_path: Path
) -> None:
    more = ("--out", tmp_path / "log") if line[0] == "record" else ()
    with going(*line, *more, "--connect", endpoint) as waiting:
        assert "for swarm demo" in waiting.stderr.readline()
        waiting.send_signal(signal.SIGINT)
        ended(waiting)
    assert not list(tmp_path.iterdir())


def test_a_coordinator_says_who_did_not_come(endpoint: str) -> None:
    at = ("--connect", endpoint)
    run_of = ("coordinate", PATH, *at, "--swarm", SWARM, *SMALL, "--patience", 4)
    with going(*run_of) as coordinator, going("join", SWARM, *at, "--cells", "0-4"):
        said = ended(coordinator, 1)
    rule = "swarm: every part must come up within 4 s, missing:"
    assert f"{rule} cell/5, recorder, world" in said


WRONG = {
    "more cells": (
        ("join", SWARM, "--cells", "4-9"),
        2,
        "part: must be one the run leaves to others: cell/0,",
    ),
    "workers": (("join", SWARM, "--workers", "0"), 2, "got 'worker/0'"),
    "another world": (
        ("world", SWARM, "neurosnap/Cycle-v0"),
        2,
        "source: must be what the coordinator runs, neurosnap/Path-v0, got",
    ),
    "a recorder": (("record", SWARM), 2, "got 'recorder'"),
    "the same cell": (
        ("join", SWARM, "--cells", "5"),
        1,
        "cell/5: must be there once, is in demo already",
    ),
    "a coordinator": (
        ("coordinate", PATH, "--swarm", SWARM),
        1,
        "swarm demo: must have one coordinator, has one already",
    ),
}


def test_who_does_not_fit_is_refused_and_the_run_minds_nothing(
    endpoint: str, tmp_path: Path
) -> None:
    at = ("--connect", endpoint)
    whole = ("coordinate", PATH, *at, "--swarm", SWARM, *SMALL, "--ticks", 20)
    with (
        going(*whole, "--no-record") as coordinator,
        going("join", SWARM, *at, "--cells", "0-5") as cells,
    ):
        up(endpoint, "coordinator", *(f"cell/{n}" for n in range(CELLS)))
        for name, (line, code, text) in WRONG.items():
            more = ("--out", tmp_path / "log") if line[0] == "record" else ()
            with going(*line, *more, *at) as wrong:
                assert text in ended(wrong, code), name
        with going("world", SWARM, PATH, *at) as world:
            assert "20 in" in ended(coordinator)
            ended(cells)
            ended(world)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (("join", "a/b", "--cells", "0"), "swarm: must be letters and digits"),
        (("join", SWARM), "join: must say which --cells, or which --workers"),
        (("join", SWARM, "--cells", "0", "--workers", "0"), "join: must say which"),
        (("join", SWARM, "--cells", "3,3"), "cells: must name each once, got '3,3'"),
        (("record", SWARM, "--out", "/nowhere/x"), "out: must be in a folder that"),
        (("coordinate", PATH, "--swarm", ""), "swarm: must be letters and digits"),
        (("world", SWARM, PATH, "--restart", "now"), "Invalid value for '--restart'"),
    ],
    ids=lambda given: " ".join(map(str, given)) if isinstance(given, tuple) else "",
)
def test_wrong_usage_is_refused_at_once(line: tuple[str, ...], text: str) -> None:
    with going(*line, "--connect", "tcp/127.0.0.1:1") as wrong:
        assert text in ended(wrong, 2)


VERBS = ("coordinate", "world", "join", "record")


@pytest.mark.parametrize("who", VERBS)
def test_each_of_them_can_be_stopped_in_the_midst(
    who: str, endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    stay = ("--restart", "never")
    lines: dict[str, tuple[object, ...]] = {
        "coordinate": (PATH, "--swarm", SWARM, *ENDLESS, "--deadline", 1),
        "world": (SWARM, PATH, *stay),
        "join": (SWARM, "--cells", "0-5", *stay),
        "record": (SWARM, "--out", log, *stay),
    }
    with ExitStack() as stack:
        parts = {
            verb: stack.enter_context(going(verb, *line, *at))
            for verb, line in lines.items()
        }
        begun(endpoint, 5)
        parts[who].send_signal(signal.SIGINT)
        # Whoever stops the coordinator or the world ends the run in order; who takes
        # cells or the recorder away makes it fail.
        in_order = who in ("coordinate", "world")
        said = ended(parts["coordinate"], 0 if in_order else 1)
        codes = {verb: parts[verb] for verb in VERBS if verb != "coordinate"}
        for verb, part in codes.items():
            part.communicate(timeout=PATIENCE)
            if verb != "record":
                assert part.returncode == 0
    if who == "record":
        assert "recorder: must stay until the run ends, is gone" in said
        assert parts["record"].returncode == 3
        assert not verify(log).complete
    if in_order:
        assert parts["record"].returncode == 0
        verdict = verify(log)
        assert (verdict.same, verdict.complete) == (True, True)
    assert verify(log).ticks >= 4
