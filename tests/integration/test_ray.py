"""Parts on a three-node Ray cluster give the same result as processes."""

import asyncio
import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import psutil
import pytest
import ray
from ray.cluster_utils import Cluster
from ray.util import placement_group_table

from neurosnap.errors import (
    InvalidValueError,
    NothingBegunError,
    PartDiedError,
    SwarmError,
)
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.network import PRIVATE
from neurosnap.runtime.ray_starter import RayActors
from neurosnap.runtime.request import (
    SILENT,
    Outcome,
    Placement,
    RunRequest,
    Site,
    Watcher,
)
from neurosnap.runtime.run_with_restarts import run
from neurosnap.runtime.supervisor import Supervisor
from tests.support.command_line import flat, last_json
from tests.support.course import course
from tests.support.disturbed_commands import (
    GROWN,
    finish,
    sound,
    started,
    wait_for_size,
)
from tests.support.disturbed_runs import ENDLESS, Disturbed, check_same, options_for
from tests.support.hanging_worlds import ending_world
from tests.support.patience import PATIENCE
from tests.support.recorded_messages import assert_true_run

pytestmark = [
    pytest.mark.exhaustive,
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:::ray"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


class Nodes:
    """A cluster, whose first node is this process's.

    Each listens on 127.0.0.1 alone, and nothing is reported to anybody.
    """

    def __init__(self, *cpus: int) -> None:
        # Ray waits 30 s for a node, and a busy machine may take longer to start one.
        until = time.monotonic() + PATIENCE
        while True:
            self._cluster = Cluster()
            try:
                self._nodes = [self._add(count) for count in cpus]
            except Exception as error:
                self.close()
                slow = "timed out during startup" in str(error)
                if not slow or time.monotonic() > until:
                    raise
            else:
                return

    def _add(self, cpus: int) -> Any:
        where = "127.0.0.1"
        return self._cluster.add_node(
            num_cpus=cpus, node_ip_address=where, include_dashboard=False
        )

    @property
    def address(self) -> str:
        return str(self._cluster.address)

    def id(self, number: int) -> str:
        return str(self._nodes[number].node_id)

    def kill(self, number: int) -> None:
        """Kill a node, as if its machine had lost its power."""
        self._cluster.remove_node(self._nodes[number], allow_graceful=False)

    def close(self) -> None:
        self._cluster.shutdown()


def actors() -> list[psutil.Process]:
    """Return the processes of parts that Ray runs on this machine."""
    found = []
    for process in psutil.process_iter():
        try:
            # Ray adds the method that is running to the name.
            if process.name().startswith("ray::RayPart"):
                found.append(process)
        except psutil.Error:
            continue  # it has ended meanwhile
    return found


def actors_are_gone() -> bool:
    """Wait until no part is left."""
    _, alive = psutil.wait_procs(actors(), timeout=PATIENCE)
    return not alive


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    """Three nodes, none of which may be killed."""
    with closing(Nodes(2, 2, 2)) as three:
        yield three


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    yield
    assert not ray.is_initialized()
    assert actors_are_gone()


def in_workers(options: RunOptions, workers: int = 3) -> RunOptions:
    return msgspec.structs.replace(options, cells="worker", workers=workers)


def on(nodes: Nodes) -> Placement:
    return Placement(place="ray", address=nodes.address)


async def ran(
    options: RunOptions, log: Path, nodes: Nodes, watcher: Watcher = SILENT
) -> Outcome:
    """Run on a cluster; where parts come up slowly, no one is late."""
    options = msgspec.structs.replace(options, deadline=PATIENCE)
    site = Site(placement=on(nodes), patience=PATIENCE)
    request = RunRequest(options, log, site=site)
    return await run(request, asyncio.Event(), watcher)


async def test_workers_are_spread_and_the_run_is_the_same(
    nodes: Nodes, tmp_path: Path
) -> None:
    log, calm = tmp_path / "log", tmp_path / "calm"
    options = in_workers(options_for(60))
    places: set[tuple[str, ...]] = set()

    def look(_: int) -> None:
        for group in placement_group_table().values():
            if group["state"] == "CREATED":
                found = group["bundles_to_node_id"]
                places.add(tuple(found[number] for number in sorted(found)))

    outcome = await ran(options, log, nodes, Watcher(look))
    (place,) = places
    assert place[0] == nodes.id(0)
    assert set(place) == {nodes.id(number) for number in range(3)}
    assert outcome.complete
    assert_true_run(log, ticks=60)
    inline = msgspec.structs.replace(options, cells="inline")
    undisturbed = await run(RunRequest(inline, calm), asyncio.Event())
    assert outcome.implications == undisturbed.implications
    assert course(log) == course(calm)


class Unplugged(Disturbed):
    """A run whose nodes die: victims are their numbers."""

    nodes: Nodes

    def strike(self, victims: tuple[str, ...]) -> bool:
        for victim in victims:
            self.nodes.kill(int(victim))
        return True


def test_nodes_that_die_are_parts_that_died(tmp_path: Path) -> None:
    """Both nodes that hold nothing but workers die, one after the other."""
    log, calm = tmp_path / "log", tmp_path / "calm"
    options = in_workers(options_for(ENDLESS))
    with closing(Nodes(4, 2, 2)) as doomed:
        unplugged = Unplugged(options, log)
        unplugged.nodes = doomed
        outcome = asyncio.run(
            unplugged.running(
                (20, ("1",)), (20, ("2",)), site=Site(placement=on(doomed))
            )
        )
    assert len(unplugged.restarts) == 2
    for event in unplugged.restarts:
        # Ray may notice it after the coordinator does, whom the worker left.
        by_ray = "its actor: " in event.why
        by_swarm = event.why.startswith("coordinator: worker/")
        assert by_ray or by_swarm, event.why
    check_same(outcome, unplugged, log, options, calm)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]


async def test_a_part_that_fails_is_named_in_its_own_words(
    nodes: Nodes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail = 'raise RuntimeError("the sensors are off")'
    options = in_workers(ending_world(tmp_path, monkeypatch, fail))
    with pytest.raises(
        SwarmError, match=r"(?s)^world: .*the sensors are off"
    ) as raised:
        await ran(options, tmp_path / "log", nodes)
    assert not isinstance(raised.value, PartDiedError)
    assert verify(tmp_path / "log").ticks == 6


@pytest.mark.parametrize(
    ("place", "number"), [("cluster", signal.SIGINT), ("local", signal.SIGTERM)]
)
def test_a_run_that_is_interrupted_ends_in_order(
    nodes: Nodes,
    place: str,
    number: signal.Signals,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    token = tmp_path / "token"  # a cluster of its own would write one at home
    token.write_text("0" * 64, encoding="utf-8")
    monkeypatch.setenv("RAY_AUTH_TOKEN_PATH", str(token))
    monkeypatch.setenv("RAY_OVERRIDE_RESOURCES", '{"CPU": 3}')
    log = tmp_path / "out.mcap"
    address = nodes.address if place == "cluster" else "local"
    with started(
        *("run", "neurosnap/Path-v0", "--ticks", ENDLESS),
        *("--out", log, "--format", "json"),
        *("--set", "placement.place=ray", "--set", f"placement.address={address}"),
        folder=tmp_path,
    ) as process:
        wait_for_size(process, log, GROWN)
        family = psutil.Process(process.pid).children(recursive=True)
        assert len(actors()) == 6  # hub, recorder, coordinator, world and two workers
        if place == "local":
            # Ray's own processes, which are ours then, take no order at such a signal.
            process.send_signal(number)
        else:
            os.killpg(process.pid, number)  # as a terminal does: to all of them
        code, stdout, stderr = finish(process)
    assert code == 0, stderr
    facts = last_json(stdout)
    assert (facts["stopped"], facts["complete"]) == (True, True)
    verdict = sound(log)
    assert verdict.complete
    assert verdict.ticks == facts["ticks"]
    assert "(2 workers, " in flat(stderr)
    _, alive = psutil.wait_procs(family, timeout=30)
    assert not alive


# What cannot be -----------------------------------------------------------------------


@contextmanager
def taken(nodes: Nodes) -> Iterator[None]:
    """Somebody else has all that there is."""
    ray.init(nodes.address, log_to_driver=False)
    group = ray.util.placement_group([{"CPU": 2.0}] * 3)
    assert group.wait()
    try:
        yield
    finally:
        ray.util.remove_placement_group(group)
        ray.shutdown()


WORKERS = ["hub", "worker/0", "worker/1"]


async def test_a_cluster_that_is_too_small_says_what_it_lacks(
    nodes: Nodes, tmp_path: Path
) -> None:
    options = in_workers(options_for(60), workers=4)
    with closing(Nodes(2, 1)) as small, pytest.raises(InvalidValueError) as raised:
        await ran(options, tmp_path / "log", small)
    assert str(raised.value) == (
        "workers: must fit the cluster: it must have 5 CPUs, 1 for each of 4 workers"
        " and 1 for all other parts, has 3 on 2 nodes (add nodes with `ray start`, or"
        " take fewer --workers), got 4"
    )


async def test_room_that_others_have_is_waited_for(nodes: Nodes) -> None:
    stop = asyncio.Event()
    stop.set()
    rule = r"^ray: must have 3 free CPUs .* has 0$"
    with taken(nodes):
        for again, kind in ((False, SwarmError), (True, PartDiedError)):
            starter = RayActors(nodes.address, PRIVATE, again=again, patience=0)
            async with Supervisor(starter) as supervisor:
                with pytest.raises(kind, match=rule) as raised:
                    await supervisor.make_room(WORKERS, asyncio.Event())
            assert type(raised.value) is kind
        async with Supervisor(RayActors(nodes.address, PRIVATE)) as supervisor:
            with pytest.raises(NothingBegunError, match="room on the Ray cluster"):
                await supervisor.make_room(WORKERS, stop)
    # Room that went with a node may come back.
    many = [f"worker/{number}" for number in range(6)]
    async with Supervisor(RayActors(nodes.address, PRIVATE, again=True)) as supervisor:
        lack = r"^ray: must have 7 CPUs, .* has 6 on 3"
        with pytest.raises(PartDiedError, match=lack):
            await supervisor.make_room(many, asyncio.Event())


@pytest.mark.parametrize(
    ("address", "error", "text"),
    [
        ("127.0.0.1:9", SwarmError, "must have a cluster at .*, which does not answer"),
        ("nowhere", InvalidValueError, "must be HOST:PORT, auto or local"),
        ("ray://127.0.0.1:10001", InvalidValueError, "this machine is a node of"),
    ],
)
async def test_a_cluster_that_is_not_there_is_told_of_at_once(
    address: str, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        async with Supervisor(RayActors(address, PRIVATE)):
            pytest.fail("there is none")
