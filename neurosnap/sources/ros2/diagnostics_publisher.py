"""Publishes what is believed of a run's sensors as ``/diagnostics`` of ROS 2.

All of it is said each second, as a node of ROS 2 says its diagnostics, and as soon as
anything is new. What is new at several ticks may be said at once; a tick with an
anomaly is always said.

A node of Humble reads another attachment than we write, and may end of ours. If one is
in the graph at the start of a run, that is an error; if one comes later, our node
leaves the graph and says so, and the run goes on. Nodes of the first releases for
Jazzy, which cannot be told from later ones by the graph, are not found.
"""

import asyncio
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from neurosnap import wire
from neurosnap.errors import FabricError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.connect_session import when_lost
from neurosnap.sensorium import unpack, unpack_readings
from neurosnap.sources.ros2.diagnostics import ARRAY, Bit, Diagnostics
from neurosnap.sources.ros2.graph import open_session
from neurosnap.sources.ros2.node import RosNode
from neurosnap.sources.ros2.options import Ros2Options, Ros2Publish

if TYPE_CHECKING:
    import zenoh

    from neurosnap.health.alarm import Standing

_EVERY = 1.0
"""Seconds after which all is said again: others take what is silent for dead."""
_WAITING = 64  # anomalies; with more that are not said yet, the oldest is dropped
_TRY = 2.0  # seconds a router may take to answer, until it is tried again
_logger = logging.getLogger(__name__)


class DiagnosticsPublisher:
    """Publishes one run.

    Its methods but `serve` may be called from any thread, one at a time, before `serve`
    as well; they do not wait.

    Args:
        options: Where to, and what it is called: `options.publish`.
        sensors: The names of all sensors of the run, contextual ones included.
        own: How many of them, from the first on, are published.
        resumed: The run goes on, so that nothing is an error at the start.
        clock: Nanoseconds since 1970.

    Raises:
        MissingExtraError: `rosbags` is not installed.
    """

    def __init__(
        self,
        options: Ros2Options,
        sensors: Sequence[str],
        own: int,
        *,
        resumed: bool = False,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self._options, self._publish = options, options.publish or Ros2Publish()
        self._count, self._own, self._clock = len(sensors), own, clock
        self._begins = not resumed
        self._said = Diagnostics(sensors[:own])
        self._lock = threading.Lock()  # held for what follows
        self._reads: dict[int, list[Bit]] = {}
        self._believed: tuple[int, list[Bit]] = (0, [])
        self._wrong: Mapping[str, Any] | None = None
        self._begun = self._dropped = False
        self._waiting: deque[Any] = deque(maxlen=_WAITING)
        self._wake: Callable[[], object] = lambda: None

    def observation(self, message: wire.Observation) -> None:
        """Take in what the sensors read.

        Raises:
            ShapeError: It is of another number of sensors.
        """
        bits, known = unpack_readings(message.bits, message.known, self._count)
        read: list[Bit] = bits[: self._own].tolist()
        if known is not None:
            sure = known[: self._own].tolist()
            read = [
                bit if is_known else None
                for bit, is_known in zip(read, sure, strict=True)
            ]
        with self._lock:
            self._reads[message.tick] = read
            self._follow()

    def state(self, message: wire.State) -> None:
        """Take in what is believed.

        Raises:
            ShapeError: It is the state of another number of sensors.
        """
        literals = unpack(message.literals, 2 * self._count)[: 2 * self._own]
        pairs = zip(literals[::2].tolist(), literals[1::2].tolist(), strict=True)
        with self._lock:
            held = [on if on is not off else None for on, off in pairs]
            self._believed = message.tick, held
            self._follow()

    def anomaly(self, record: Mapping[str, Any] | None) -> None:
        """Take in an anomaly, as `anomaly_record` returns it; None if it is over."""
        if record is not None:
            with self._lock:
                self._wrong = record
                self._follow()

    def decision(self, _: wire.Decision) -> None:
        """Pass over a decision: it is no matter of sensors."""

    def health(self, _: "Standing") -> None:
        """Pass over alarms: they are about days."""

    def _follow(self) -> None:
        """Say what is new, if all of a tick is there."""
        tick, believed = self._believed
        self._reads = {at: row for at, row in self._reads.items() if at >= tick}
        if (reads := self._reads.get(tick)) is None:
            return
        wrong = self._wrong if self._wrong and self._wrong["tick"] == tick else None
        self._begun = True
        if self._said.follow(tick, reads, believed, wrong):
            if wrong is not None:
                if len(self._waiting) == _WAITING and not self._dropped:
                    self._dropped = True
                    _logger.warning(
                        "ros2: more than %d anomalies wait: the oldest are"
                        " not published",
                        _WAITING,
                    )
                self._waiting.append(self._said.array(self._clock()))
            self._wake()

    async def serve(self, stop: asyncio.Event) -> None:
        """Publish until `stop` is set.

        Raises:
            FabricError: At the start of a run only: the router does not answer, or a
                node of Humble is in the graph.
        """
        try:
            while (session := await self._session(stop)) is not None:
                with session:
                    await self._serve(session, stop)
        except FabricError as error:
            if not self._begins:
                _logger.warning("%s: nothing is published any more", error)
            else:
                raise
        await stop.wait()

    async def _session(self, stop: asyncio.Event) -> "zenoh.Session | None":
        """Return a session; None if there was none until `stop` was set."""
        told, patience = False, self._options.patience if self._begins else _TRY
        while not stop.is_set():
            try:
                return await asyncio.to_thread(
                    open_session, self._options.router, patience
                )
            except FabricError as error:
                if self._begins:
                    raise
                if not told:
                    told = True
                    _logger.warning("%s; it goes on trying", error)
        return None

    async def _serve(self, session: "zenoh.Session", stop: asyncio.Event) -> None:
        """Publish until `stop` is set or the router goes."""
        loop, new, lost = asyncio.get_running_loop(), asyncio.Event(), asyncio.Event()
        domain, clock = self._options.domain, self._clock
        end = when_lost(session, lambda: loop.call_soon_threadsafe(lost.set))
        try:
            node = await asyncio.to_thread(
                RosNode, session, self._publish.node, domain=domain, clock=clock
            )
            publisher = node.publisher(self._publish.topic, ARRAY)
            self._begins = False
            self._wakes(lambda: loop.call_soon_threadsafe(new.set))
            while not (stop.is_set() or lost.is_set()):
                new.clear()
                for array in self._due():
                    publisher.publish(array)
                await wait_any(new, lost, stop, seconds=_EVERY)
        finally:
            self._wakes(lambda: None)
            end()

    def _wakes(self, wake: Callable[[], object]) -> None:
        with self._lock:
            self._wake = wake

    def _due(self) -> list[Any]:
        """Return what is to be said now."""
        with self._lock:
            due = [*self._waiting]
            self._waiting.clear()
            if self._begun:
                due.append(self._said.array(self._clock()))
            return due
