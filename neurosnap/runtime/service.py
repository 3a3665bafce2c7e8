"""Serves parts of a swarm from any host that reaches the hub.

A service waits for a coordinator of its swarm's id, gets the description of the run,
starts its parts and ends them once that coordinator has gone. It need not be started in
any order, and a swarm that goes on after a death finds its services waiting.
"""

import asyncio
import contextlib
from collections.abc import Callable, Collection, Mapping, Sequence

import msgspec

from neurosnap import wire
from neurosnap.errors import (
    InvalidValueError,
    MessageError,
    NeurosnapError,
    PartDiedError,
    SwarmError,
)
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.discovery import FoundSwarm
from neurosnap.runtime.network import Connections, Network
from neurosnap.runtime.parts.coordinator_process import read_description
from neurosnap.runtime.parts.job import PartConnection
from neurosnap.runtime.remote_parts import ChooseParts, RemotePart
from neurosnap.runtime.supervisor import RunningPart, Supervisor

_GRACE = 10.0  # seconds a part may take to end
_LAST_WORDS = ("fault/coordinator", "leave/coordinator")
_LAST_WORD = 0.5  # seconds a coordinator's last word may come after it has gone


class Served(msgspec.Struct, frozen=True):
    """One swarm that a service took part in."""

    swarm: str
    """What it was called on the wire."""
    trouble: str
    """Why it did not end in order; empty: it did."""
    results: Mapping[str, bytes]
    """The results of the parts, as JSON, by name."""


async def serve(
    choose: ChooseParts,
    network: Network,
    swarm: str,
    stop: asyncio.Event,
    *,
    stays: bool = False,
    patience: float = 60.0,
    on_served: Callable[[Served], None] = lambda _: None,
) -> None:
    """Run some parts of a swarm, a process each. No process outlives the call.

    Args:
        choose: Which parts.
        network: Where the hub is; `Network.connect` names it.
        swarm: The swarm's id.
        stop: Ends it; a swarm that goes on without these parts fails.
        stays: Wait for whatever comes next under this id, without end. If not, a swarm
            that ended in order is the last; where its coordinator vanished or failed,
            or a part of this service died, its next incarnation follows.
        patience: Seconds until the hub answers, until a coordinator is there, and until
            the next incarnation is; where it stays, as long as it takes.
        on_served: Called with each swarm when it is over.

    Raises:
        InvalidValueError: The network cannot be, or, unless it stays, the run is not
            one for these parts.
        SwarmError: None came; or, unless it stays, a part failed, would not end, or was
            there already.
    """
    if not network.connect:
        rule = "must say where the hub of the swarm listens"
        raise InvalidValueError("connect", rule, network.connect)
    network.check("watcher")
    connections = Connections(network)
    wait = None if stays else patience
    trouble = ""
    async with connections.discovery(swarm, stop, patience) as discovery:
        while True:
            try:
                seen = await discovery.next(stop, wait)
            except TimeoutError:
                rule = "must go on" if trouble else "must have a coordinator"
                got = f"after {trouble}" if trouble else "none came"
                text = f"swarm {swarm}: {rule} within {patience:g} s, {got}"
                raise SwarmError(text) from None
            if seen is None:
                return
            try:
                served = await _take_part(choose, connections, seen, stop)
            except NeurosnapError as error:
                if not (stays or isinstance(error, PartDiedError)):
                    raise
                served = Served(seen.name, str(error), {})
            on_served(served)
            trouble = served.trouble
            if stop.is_set() or not (stays or trouble):
                return


async def _take_part(
    choose: ChooseParts, connections: Connections, seen: FoundSwarm, stop: asyncio.Event
) -> Served:
    """Run the parts in one swarm until it is over, or the service is to stop."""
    ending = _Ending()
    async with connections.to("watcher", seen.name).fabric() as fabric:
        await fabric.subscribe(_LAST_WORDS, ending.handle)
        content = await fabric.ask()
        if content is None:
            return Served(seen.name, "its coordinator vanished", {})
        description = read_description(content)
        parts = await asyncio.to_thread(choose, seen.name, description)
        names = [part.who for part in parts]
        description.check_vacant(names)
        for who in sorted(await fabric.present() & set(names)):
            raise SwarmError(f"{who}: must be there once, is in {seen.name} already")
        given = [
            (part, connections.to(part.who, seen.name, description.first(part.who)))
            for part in parts
        ]
        ending.own = {f"{one.who}/{one.instance}" for _, one in given}
        results = await _run(given, stop, seen.gone, ending)
        trouble = "" if stop.is_set() else await ending.trouble()
    return Served(seen.name, trouble, results)


async def _run(
    given: Sequence[tuple[RemotePart, PartConnection]],
    stop: asyncio.Event,
    gone: asyncio.Event,
    ending: "_Ending",
) -> dict[str, bytes]:
    """Run the parts until `gone`, or one is refused; return their results."""
    grace = _GRACE + 0.02 * len(given)
    names = [part.who for part, _ in given]
    async with Supervisor() as supervisor:
        await supervisor.make_room(names, stop)
        started = await _start(supervisor, given)
        await wait_any(supervisor.failed, stop, gone, ending.refused)
        if ending.refused.is_set():
            supervisor.blame(SwarmError(ending.complaint))
        for (part, _), running in zip(given, started, strict=False):
            if part.lingers and gone.is_set():
                ends = supervisor.failed, stop, running.ended
                await wait_any(*ends, seconds=grace)
        if ending.refused.is_set() or isinstance(supervisor.error, PartDiedError):
            # Who left in order now would be blamed, or leave in another's name.
            await supervisor.kill(names)
        late = await supervisor.end(names, grace)
        if supervisor.error is not None:
            raise supervisor.error
    if late:
        rule = "every part must end when asked to"
        raise PartDiedError(f"swarm: {rule}, killed: {', '.join(late)}")
    return {
        running.who: running.result for running in started if running.result is not None
    }


async def _start(
    supervisor: Supervisor, given: Sequence[tuple[RemotePart, PartConnection]]
) -> list[RunningPart]:
    """Start the parts; return those with a line of their own.

    Where there are many, they are cells, which have no results.
    """
    jobs = [(part.job, connection) for part, connection in given]
    if len(jobs) > 1:
        await supervisor.start_many(jobs)
        return []
    return [await supervisor.start(*each) for each in jobs]


class _Ending:
    """How a swarm ends, by its coordinator's last words."""

    def __init__(self) -> None:
        self._left = asyncio.Event()
        self.own: Collection[str] = ()  # parts of this service, each as an instance
        self.refused = asyncio.Event()
        self.complaint = ""
        self._complained = -1  # the number of its last fault

    def handle(self, deliveries: list[wire.Delivery]) -> None:
        """Receive faults and last words."""
        for delivery in deliveries:
            with contextlib.suppress(MessageError):
                message = wire.decode(delivery.key, delivery.payload)
                if message.sender == "coordinator":
                    self._receive(message, delivery.sequence)

    def _receive(self, message: wire.Message, sequence: int) -> None:
        if isinstance(message, wire.Fault):
            self.complaint, self._complained = message.what, sequence
            if message.what.partition(":")[0] in self.own:
                self.refused.set()
        elif isinstance(message, wire.Leave):
            # Who fails says why and leaves in one go; any other fault is a message
            # that it dropped.
            if self._complained != sequence - 1:
                self.complaint = ""
            self._left.set()

    async def trouble(self) -> str:
        """Return why it did not end in order; empty: it did.

        Called once the coordinator has gone. Its last word travels apart from its
        presence, and may be on the way.
        """
        await wait_any(self._left, seconds=_LAST_WORD)
        if not self._left.is_set():
            return "its coordinator vanished without a word"
        return self.complaint
