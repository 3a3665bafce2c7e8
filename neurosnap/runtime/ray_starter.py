"""Runs parts as actors on the nodes of a Ray cluster.

Room for all of them is reserved at once, as one placement group: either every part can
be started, or none is. Workers are spread over the nodes. All other parts are on the
node of this process, since recordings, journals, sources and keys are files there.

Ray carries jobs and reports, and what it carries it unpickles: it is for a cluster
whose every user is trusted. The messages of the swarm go over its hub, as always.

Functions that talk to Ray block, and are called on one thread: what Ray starts for this
process ends with the thread that started it.
"""

import asyncio
import logging
import math
import os
import re
import socket
import sys
import time
from collections.abc import (
    AsyncIterator,
    Awaitable,
    Callable,
    Collection,
    Coroutine,
    Sequence,
)
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, ParamSpec, TypeAlias, TypeVar

import ray
from ray.exceptions import RayActorError, RayError, RayTaskError
from ray.util.placement_group import (
    PlacementGroup,
    placement_group,
    remove_placement_group,
)
from ray.util.scheduling_strategies import PlacementGroupSchedulingStrategy

from neurosnap.errors import (
    InvalidValueError,
    NothingBegunError,
    PartDiedError,
    SwarmError,
)
from neurosnap.fabric.hub_address import stays_here
from neurosnap.protocol.run_options import CellKind
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.job import (
    Failed,
    Job,
    PartConnection,
    PartContext,
    Reporter,
    carry_out,
    decode_report,
)
from neurosnap.runtime.starter import Listener

P = ParamSpec("P")
T = TypeVar("T")
Actor: TypeAlias = Any
"""A handle of a `RayPart`, whose methods Ray adds at run time."""
Work: TypeAlias = Coroutine[Any, Any, None]
_PATIENCE = 60.0  # seconds that others may take to give room back
_LOOK = 0.2  # seconds between two looks at a stop request
_LAST_WORD = 10.0  # seconds in which Ray must say that who was killed is dead
_SERVICE = 0.2  # CPUs: five of them share one, since they wait for each other
_REASON = re.compile(r"because (.+?)[.\n]")
_SHOWN = 2000  # characters of what Ray says of an actor that could not begin


class RayPart:
    """One part, in the process that Ray starts for it.

    Args:
        who: Its name.
        folder: The working folder of its launcher.
        path: Where its launcher looks for modules: a world may be of one that the
            nodes of the cluster were started without.
        shared: It is on the same machine, so files are looked for in that folder. On
            another machine they are, too, if that has such a folder.
    """

    def __init__(
        self, who: str, folder: str, path: Sequence[str], *, shared: bool
    ) -> None:
        self._who = who
        self._stop = asyncio.Event()
        sys.path += [place for place in path if place not in sys.path]
        if shared:
            os.chdir(folder)
        else:
            with suppress(OSError):
                os.chdir(folder)

    def __repr__(self) -> str:
        """Return its name, which Ray writes before what it logs."""
        return self._who

    async def live(self, job: Job, connection: PartConnection) -> AsyncIterator[bytes]:
        """Run a job, and yield its reports as they come, until it has ended."""
        line = _Line()
        context = PartContext(connection, self._stop, Reporter(self._who, line))
        working = asyncio.create_task(carry_out(job, context), name=self._who)
        working.add_done_callback(line.close)
        while (report := await line.said.get()) is not None:
            yield report
        await working

    async def end(self) -> None:
        """Ask the job to end in order."""
        self._stop.set()


class _Line:
    """A queue that any thread writes to and the event loop reads."""

    def __init__(self) -> None:
        self.said: asyncio.Queue[bytes | None] = asyncio.Queue()
        self._loop = asyncio.get_running_loop()

    def send_bytes(self, buf: bytes, /) -> None:
        self._loop.call_soon_threadsafe(self.said.put_nowait, buf)

    def close(self, _: object) -> None:
        self.said.put_nowait(None)


class RayActors:
    """Starts every part as an actor.

    Args:
        address: The cluster's; see `neurosnap.runtime.ray_starter.connect`.
        network: Where the hub is, which every node must reach.
        again: The run goes on after a death. Then a lack of room is a death, too, which
            the policy of restarts deals with: a node may come back.
        patience: Seconds to wait for room that others have.
    """

    has_hub = True

    def __init__(
        self,
        address: str,
        network: Network,
        *,
        again: bool = False,
        patience: float = _PATIENCE,
    ) -> None:
        self._address = address
        self._network = network
        self._again = again
        self._patience = patience
        self._connected = False
        self._group: PlacementGroup | None = None
        self._bundles: dict[str, int] = {}  # of the group, by worker
        self._actors: dict[str, Actor] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="ray")

    @staticmethod
    def check(cells: CellKind) -> None:
        """Raise InvalidValueError for cells that are not in workers."""
        if cells != "worker":
            rule = (
                "must be 'worker' with place = \"ray\": an actor takes some 65 MB, 25 threads"
                " and 0.6 s of a processor to start (for cells as processes on several"
                " machines there is `neurosnap serve cells`)"
            )
            raise InvalidValueError("kind", rule, cells)

    async def open(self, listener: Listener) -> None:
        """Connect to the cluster, or start one."""
        self._listener = listener
        try:
            await self._aside(self._connect)
        except BaseException:
            await self.close()
            raise

    # What is to be undone is noted on the thread: who waits for it may be cancelled.

    def _connect(self) -> None:
        self._connected = _connect(self._address)
        self._own = str(ray.get_runtime_context().get_node_id())

    def _reserve(self, workers: int) -> PlacementGroup:
        self._group = _reserve(self._own, workers)
        return self._group

    def _leave(self) -> None:
        if self._group is not None:
            with suppress(RayError):  # what still runs there is killed
                remove_placement_group(self._group)
        if self._connected:
            ray.shutdown()

    async def make_room(self, parts: Collection[str], stop: asyncio.Event) -> None:
        """Reserve a CPU for each worker, and one here for all other parts.

        Raises:
            InvalidValueError: A node cannot reach the hub; or the cluster is too small.
            SwarmError: Others have the room.
            PartDiedError: Either of the last two, where the run goes on.
            NothingBegunError: `stop` was set first.
        """
        workers = sorted(who for who in parts if who.startswith("worker/"))
        found = await self._aside(_nodes)
        endpoint = self._network.connect or self._network.listen
        _check_reach(found, self._own, endpoint)
        if lack := _missing(found, self._own, len(workers)):
            remedy = "add nodes with `ray start`, or take fewer --workers"
            if self._again:
                raise PartDiedError(f"ray: must have {lack} ({remedy})")
            rule = f"must fit the cluster: it must have {lack} ({remedy})"
            raise InvalidValueError("workers", rule, len(workers))
        group = await self._aside(self._reserve, len(workers))
        until = time.monotonic() + self._patience
        while not await self._aside(group.wait, _LOOK):
            if stop.is_set():
                rule = "must have room on the Ray cluster"
                raise NothingBegunError(f"swarm: {rule}, got a stop request")
            if time.monotonic() >= until:
                resources = await self._aside(ray.available_resources)
                free = resources.get("CPU", 0.0)
                kind = PartDiedError if self._again else SwarmError
                rule = f"must have {len(workers) + 1} free CPUs within"
                raise kind(f"ray: {rule} {self._patience:g} s, has {free:g}")
        self._bundles = {who: 1 + number for number, who in enumerate(workers)}

    async def start(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start an actor per job."""
        if self._group is None:
            raise RuntimeError("room must be made before anything is started")
        names = [each for _, each in jobs]
        actors = await self._aside(self._start, self._group, names)
        for (job, connection), actor in zip(jobs, actors, strict=True):
            who = connection.who
            self._listener.began(who, _Handle(actor, self._watch))
            self._watch(self._follow(who, actor, job, connection), f"ray/{who}")

    def _start(
        self, group: PlacementGroup, connections: Sequence[PartConnection]
    ) -> list[Actor]:
        """Start actors, which come up by themselves."""
        folder = os.getcwd()  # noqa: PTH109 - given as text
        for connection in connections:
            who = connection.who
            bundle = self._bundles.get(who, 0)
            remote = ray.remote(RayPart).options(
                name=f"{connection.swarm}/{who}",
                num_cpus=1.0 if bundle else _SERVICE,
                scheduling_strategy=PlacementGroupSchedulingStrategy(
                    group, placement_group_bundle_index=bundle
                ),
            )
            given = who, folder, sys.path
            self._actors[who] = remote.remote(*given, shared=not bundle)
        return [self._actors[connection.who] for connection in connections]

    async def _follow(
        self, who: str, actor: Actor, job: Job, connection: PartConnection
    ) -> None:
        """Pass on the reports of a part, until it has ended."""
        how, in_order = "no error", True
        try:
            async for report in actor.live.remote(job, connection):
                self._listener.receive(decode_report(await report))
        except Exception as error:  # noqa: BLE001 - whatever it is, the part has ended
            reason, in_order = _REASON.search(str(error)), False
            how = f"its actor: {reason[1] if reason else error!r}"
            if _would_again(error):
                what = f"must be able to begin: {error}"
                self._listener.receive(Failed(who, what[:_SHOWN]))
        with suppress(RayError):
            ray.kill(actor)  # it has ended, and its process goes on
        self._listener.ended(who, how, in_order=in_order)

    async def close(self) -> None:
        """Kill what is left, give its room back and leave the cluster."""
        for actor in self._actors.values():
            with suppress(RayError):
                ray.kill(actor)
        if self._tasks:
            _, late = await asyncio.wait(self._tasks, timeout=_LAST_WORD)
            for task in late:
                task.cancel()
        await self._aside(self._leave)
        self._thread.shutdown()

    def _watch(self, work: Work, name: str) -> None:
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _aside(
        self, function: Callable[P, T], *given: P.args, **named: P.kwargs
    ) -> T:
        """Call what blocks on the one thread for it, to its end."""
        loop = asyncio.get_running_loop()
        work = partial(function, *given, **named)
        return await loop.run_in_executor(self._thread, work)


class _Handle:
    """An actor that was started."""

    def __init__(self, actor: Actor, watch: Callable[[Work, str], None]) -> None:
        self._actor = actor
        self._watch = watch

    def ask(self) -> None:
        """Ask it to end in order."""
        self._watch(_heard(self._actor.end.remote()), "ray/end")

    def kill(self) -> None:
        """End it at once."""
        with suppress(RayError):
            ray.kill(self._actor)


async def _heard(answer: Awaitable[object]) -> None:
    """Wait for an answer that is not needed: unread, Ray would log its failure."""
    with suppress(RayError):
        await answer


def _would_again(error: Exception) -> bool:
    """Tell whether an actor failed as it would once more: it could not even begin."""
    if isinstance(error, RayActorError):
        return error.actor_init_failed
    return isinstance(error, RayTaskError) or not isinstance(error, RayError)


_ANSWER = 5.0  # seconds in which a cluster must take a connection
_NODE = "ray.io/node-id"


class Node(NamedTuple):
    """A node of the cluster that is alive."""

    id: str
    address: str
    """Of its machine."""
    cpus: float
    """What it has in all, as Ray counts them."""


def _connect(address: str) -> bool:
    """Connect this process to a cluster, as `ray.init` finds it.

    What parts log stays in Ray's logs, since with it comes what Ray itself logs.

    Args:
        address: As `ray.init` takes it; empty: that of the environment, or of this
            machine's cluster; where there is none, one is started.

    Returns:
        Whether it was not connected yet: then it is for the caller to leave.
    """
    if ray.is_initialized():
        return False
    given = address or os.environ.get("RAY_ADDRESS", "")
    if "://" in given:
        rule = "must be HOST:PORT of a cluster that this machine is a node of"
        raise InvalidValueError("address", rule, given)
    _check_answers(given)
    try:
        ray.init(
            address=given or None,
            include_dashboard=False,
            log_to_driver=False,
            logging_level=logging.CRITICAL,
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        ray.shutdown()
        raise SwarmError(f"ray: must have a cluster to connect to: {error}") from error
    return True


def _check_answers(given: str) -> None:
    """Refuse a cluster that does not answer: Ray would end the process in a minute."""
    from ray._private.services import canonicalize_bootstrap_address

    try:
        found = canonicalize_bootstrap_address(given or None)  # type: ignore[arg-type]
    except ValueError as error:
        rule = "must be HOST:PORT, auto or local"
        raise InvalidValueError("address", rule, given) from error
    except ConnectionError as error:
        rule = "must have a cluster on this machine (start one: ray start --head)"
        raise SwarmError(f"ray: {rule}, found none") from error
    if found is None:
        return  # one will be started
    host, _, port = found.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _ANSWER):
            return
    except OSError as error:
        rule = f"must have a cluster at {found}, which does not answer ({error})"
        more = "" if given else "; `ray stop` forgets one that has died"
        remedy = (
            "`placement.address` names another one, or local to start one for the run"
        )
        raise SwarmError(f"ray: {rule}: {remedy}{more}") from error


def _nodes() -> list[Node]:
    """Return the nodes that are alive."""
    return [
        Node(one["NodeID"], one["NodeManagerAddress"], one["Resources"].get("CPU", 0.0))
        for one in ray.nodes()
        if one["Alive"]
    ]


def _check_reach(found: Collection[Node], own: str, endpoint: str) -> None:
    """Refuse a hub that some node cannot reach.

    Args:
        found: The nodes.
        own: The id of this process's.
        endpoint: Where the hub listens; empty for a private socket.
    """
    machines = {node.address for node in found}
    if len(machines) < 2 or (endpoint and not stays_here(endpoint)):
        return
    here = next((node.address for node in found if node.id == own), "HOST")
    rule = (
        "must be an address of this machine that all nodes reach, such as"
        f" tls/{here}:7447 with --tls DIR: the cluster is on"
        f" {', '.join(sorted(machines))}"
    )
    raise InvalidValueError("listen", rule, endpoint)


def _missing(found: Collection[Node], own: str, workers: int) -> str:
    """Return what a cluster lacks for the services and some workers; empty: nothing.

    The services take one CPU of this process's node, and each worker one of any.
    """
    here = next((node.cpus for node in found if node.id == own), 0.0)
    if here < 1:
        return f"1 CPU on this node, for all parts but the workers, has {here:g}"
    room = sum(math.floor(node.cpus) for node in found) - 1
    if room >= workers:
        return ""
    count = "1 node" if len(found) == 1 else f"{len(found)} nodes"
    return (
        f"{workers + 1} CPUs, 1 for each of {workers} workers and 1 for all other"
        f" parts, has {room + 1} on {count}"
    )


def _reserve(own: str, workers: int) -> PlacementGroup:
    """Ask for a CPU of a node for the services, and one for each worker, spread."""
    somewhere: list[dict[str, str]] = [{} for _ in range(workers)]
    group: PlacementGroup = placement_group(
        [{"CPU": 1.0}] * (1 + workers),
        strategy="SPREAD",
        bundle_label_selector=[{_NODE: own}, *somewhere],
    )
    return group
