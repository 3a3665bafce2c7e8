"""A stream of a run's anomalies, live or recorded."""

import asyncio
import contextlib
from collections.abc import Callable, Iterator

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError, SwarmError
from neurosnap.fabric.events import wait_any
from neurosnap.fabric.zenoh.discovery import FoundSwarm
from neurosnap.protocol.anomaly_messages import Told, told
from neurosnap.recording.read.births import births_of
from neurosnap.recording.read.reader import Recording
from neurosnap.runtime.connections import Connections
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.run_description import read_description


def recorded(recording: Recording) -> Iterator[Told]:
    """Return the anomalies of a recorded run, in order.

    Raises:
        RecordingError: While iterating: it is damaged, or not a run's.
        MessageError: While iterating: an anomaly is none of such a run.
    """
    sensors = births_of(recording).body.sensors
    for each in recording.messages(("anomaly",)):
        if isinstance(each.message, wire.Anomaly):
            yield told(each.message, sensors)


def without_anomalies(recording: Recording) -> str:
    """Return what to say of a recording that has no anomalies.

    Raises:
        RecordingError: It is damaged.
    """
    ticks = sum(1 for _ in recording.messages(("state",)))
    if recording.metadata.get("watch") != "true":
        return f"anomalies were not looked for in these {ticks:,} ticks"
    return f"no anomalies in {ticks:,} ticks"


async def watch(
    network: Network,
    swarm: str,
    stop: asyncio.Event,
    on_anomaly: Callable[[Told], None],
    *,
    patience: float = 10.0,
) -> None:
    """Look on at a swarm that runs, until it is over or `stop` is set.

    A swarm that goes on after a death is looked on at further.

    Args:
        network: Where its hub is; `Network.connect` names it.
        swarm: Its id.
        stop: Ends it.
        on_anomaly: Is given each anomaly.
        patience: Seconds until a coordinator is there, the first or the next.

    Raises:
        InvalidValueError: The run does not tell of anomalies.
        SwarmError: There is no such swarm.
    """
    seen_one = False
    connections = Connections(network)
    async with connections.discovery(swarm, stop) as discovery:
        while True:
            try:
                seen = await discovery.next(stop, patience)
            except TimeoutError:
                if seen_one:
                    return
                rule = f"must have a coordinator within {patience:g} s, none came"
                raise SwarmError(f"swarm {swarm}: {rule}") from None
            if seen is None or await _look_on(connections, seen, stop, on_anomaly):
                return
            seen_one = True


async def _look_on(
    connections: Connections,
    seen: FoundSwarm,
    stop: asyncio.Event,
    on_anomaly: Callable[[Told], None],
) -> bool:
    """Look on at one incarnation; tell whether it ended in order."""
    sensors: tuple[str, ...] = ()
    over = asyncio.Event()
    early: list[wire.Anomaly] = []  # before it is known what the sensors are called

    def tell(anomaly: wire.Anomaly) -> None:
        with contextlib.suppress(MessageError):  # it is none of such a run
            on_anomaly(told(anomaly, sensors))

    def handle(deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            with contextlib.suppress(MessageError):
                match wire.decode(delivery.key, delivery.payload):
                    case wire.Anomaly() as anomaly if sensors:
                        tell(anomaly)
                    case wire.Anomaly() as anomaly:
                        early.append(anomaly)
                    case wire.Leave():
                        over.set()
                    case _:
                        pass

    async with connections.to("watcher", seen.name).fabric() as fabric:
        await fabric.subscribe(("anomaly", "leave/coordinator"), handle)
        content = await fabric.ask()
        if content is None:
            return False
        options = read_description(content).options
        if not options.watch:
            raise InvalidValueError("swarm", "must be run with --anomalies", seen.name)
        sensors = options.sensors
        for anomaly in early:
            tell(anomaly)
        await wait_any(seen.gone, over, stop)
        return over.is_set() or stop.is_set()
