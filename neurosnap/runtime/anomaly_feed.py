"""A stream of a run's anomalies, grown sensors and alarms, live or recorded."""

import asyncio
import contextlib
import heapq
from collections.abc import Callable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Self, TypeAlias

from neurosnap import wire
from neurosnap.agent.growth_in_decisions import Changed, changes_in, context_in
from neurosnap.errors import InvalidValueError, MessageError, SwarmError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.discovery import FoundSwarm
from neurosnap.health.alarm import News, Standing, news
from neurosnap.health.alarm_budget import NEVER
from neurosnap.protocol.anomaly_report import NamedAnomaly, named_anomaly, with_support
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recorded_readings import alarms_of
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.grown_sensors import Births, births_of
from neurosnap.runtime.network import Connections, Network
from neurosnap.runtime.parts.coordinator_process import read_description
from neurosnap.runtime.parts.health_listener import HealthListener, Past
from neurosnap.runtime.parts.job import WavesSoFar
from neurosnap.runtime.request import SILENT, Watcher

_PATIENCE = 10.0  # seconds until a coordinator is there, the first or the next

Fed: TypeAlias = NamedAnomaly | Changed | News


def recorded(recording: Recording, support: int | None = None) -> Iterator[Fed]:
    """Return the anomalies of a recorded run, what it grew, and its alarms, in order.

    Args:
        recording: The run's.
        support: The occasions an anomaly must rest on; if None, what the run asks for.

    Raises:
        InvalidValueError: Support is asked for, and the run did not count occasions.
        RecordingError: While iterating: it is damaged, or not a run's.
        MessageError: While iterating: an anomaly is none of such a run.
    """
    support = _support(recording.options, support)
    alarms = alarms_of(recording, recording.options)
    streams = _anomalies_and_births(recording, support), alarms
    for _, each in heapq.merge(*streams, key=itemgetter(0)):
        yield each


def _anomalies_and_births(
    recording: Recording, support: int
) -> Iterator[tuple[int, NamedAnomaly | Changed]]:
    births = births_of(recording)
    changes = births.changes()
    for anomaly in recording.all("anomaly", wire.Anomaly):
        while changes and changes[0].tick < anomaly.tick:
            yield changes[0].tick, changes.pop(0)
        if (rest := with_support(anomaly, support)) is not None:
            yield anomaly.tick, named_anomaly(rest, births.body)
    yield from ((change.tick, change) for change in changes)


def _support(options: RunOptions, wanted: int | None) -> int:
    """Return the occasions that an anomaly of a run must rest on."""
    if wanted and options.watch and not options.support:
        rule = "must be 0 for a run that did not count occasions"
        raise InvalidValueError("support", rule, wanted)
    return options.support if wanted is None else wanted


def without_anomalies(recording: Recording, support: int | None = None) -> str:
    """Return the report on a recording without anomalies.

    Args:
        recording: The run's.
        support: As for `recorded`.

    Raises:
        RecordingError: It is damaged.
    """
    ticks = sum(1 for _ in recording.messages(("state",)))
    if recording.metadata.get("watch") != "true":
        return f"anomalies were not looked for in these {ticks:,} ticks"
    untold = sum(1 for _ in recording.messages(("anomaly",)))
    if not untold:
        return f"no anomalies in {ticks:,} ticks"
    least = _support(recording.options, support)
    return (
        f"no anomalies in {ticks:,} ticks, but for {untold:,} that rest on fewer than"
        f" {least:,} occasions (--support 0 shows them)"
    )


async def watch(
    network: Network,
    swarm: str,
    stop: asyncio.Event,
    report: Callable[[Fed], None],
    *,
    support: int | None = None,
    log: Path | None = None,
    watcher: Watcher = SILENT,
) -> None:
    """Look on at a swarm that runs, until it is over or `stop` is set.

    A swarm that goes on after a death is looked on at further. Alarms in force are
    reported at the beginning.

    Args:
        network: Where its hub is; `Network.connect` names it.
        swarm: Its id.
        stop: Ends it.
        report: Is given each anomaly, each sensor that is grown or retired, each alarm
            and its end.
        support: The occasions an anomaly must rest on; if None, what the run asks for.
        log: Its recording, from which the sensors are known that may be broken. If
            None it is not here, so what is learned of them begins now.
        watcher: Its `on_waves`, on the fabric's thread, and `on_presence` are called.

    Raises:
        InvalidValueError: There is nothing to report of the run, and no watcher; or
            support is asked for, and the run does not count occasions.
        SwarmError: There is no such swarm.
    """
    seen_one = False
    connections = Connections(network)
    async with (
        _Alarms(report, log) as alarms,
        connections.discovery(swarm, stop) as discovery,
    ):
        while True:
            try:
                seen = await discovery.next(stop, _PATIENCE)
            except TimeoutError:
                if seen_one:
                    return
                rule = f"must have a coordinator within {_PATIENCE:g} s, none came"
                raise SwarmError(f"swarm {swarm}: {rule}") from None
            if seen is None:
                return
            incarnation = _Incarnation(report, alarms, support, watcher)
            if await incarnation.look_on(connections, seen, stop):
                return
            seen_one = True


class _Incarnation:
    """One incarnation of a swarm that is looked on at."""

    def __init__(
        self,
        report: Callable[[Fed], None],
        alarms: "_Alarms",
        support: int | None,
        watcher: Watcher = SILENT,
    ) -> None:
        self._report = report
        self._watcher = watcher
        self._waves = WavesSoFar()
        self._alarms = alarms
        self._support = support
        self._least = 0  # occasions
        self._births: Births | None = None
        # Before it is known what the sensors are called.
        self._early: list[tuple[wire.Message, int]] = []
        self._over = asyncio.Event()

    async def look_on(
        self, connections: Connections, seen: FoundSwarm, stop: asyncio.Event
    ) -> bool:
        """Report until it is over or `stop` is set; tell whether it ended in order."""
        topics = ["observation", "anomaly", "decision", "keyframe", "leave/coordinator"]
        topics += [] if self._watcher is SILENT else ["state", "reached"]
        async with connections.to("watcher", seen.name).fabric() as fabric:
            await fabric.subscribe(topics, self._handle)
            content = await fabric.ask()
            if content is None:
                return False
            self._begin(read_description(content).options, seen.name)
            if self._watcher is not SILENT:
                await fabric.watch(self._watcher.on_presence)
            await wait_any(seen.gone, self._over, stop)
            return self._over.is_set() or stop.is_set()

    def _begin(self, options: RunOptions, swarm: str) -> None:
        """Report what came early, now that it is known what the run is."""
        self._alarms.begin(options)
        tells = options.watch or options.body.room or options.alarms != NEVER
        if not tells and self._watcher is SILENT:
            rule = "must be run with --anomalies or --alarms"
            raise InvalidValueError("swarm", rule, swarm)
        self._least = _support(options, self._support)
        self._births = Births(options.body)
        for message, sent in self._early:
            self._receive(message, sent, self._births)

    def _handle(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            with contextlib.suppress(MessageError):
                message = wire.decode(delivery.key, delivery.payload)
                if isinstance(message, wire.Leave):
                    self._over.set()
                elif self._births is None:
                    self._early.append((message, delivery.sent))
                else:
                    self._receive(message, delivery.sent, self._births)

    def _receive(self, message: wire.Message, sent: int, births: Births) -> None:
        with contextlib.suppress(ValueError):  # it is none of such a run
            match message:
                case wire.Observation():
                    self._alarms.receive(message, sent)
                case wire.Anomaly():
                    rest = with_support(message, self._least)
                    if rest is not None:
                        self._report(named_anomaly(rest, births.body))
                case wire.Decision():
                    births.follow(message)
                    for change in _changes(message, births):
                        self._report(change)
                case wire.State() | wire.Reached():
                    self._waves.add(message)
                    self._watcher.on_waves(self._waves)
                case wire.KeyFrame():  # what was grown before it was looked on at
                    births.follow(message)
                case _:
                    pass


class _Alarms:
    """Reports the alarms of a run that is looked on at."""

    def __init__(self, report: Callable[[Fed], None], log: Path | None) -> None:
        self._report = report
        self._past = None if log is None else Past(log)
        self._last: Standing | None = None
        self._stop = asyncio.Event()
        self._listener: HealthListener | None = None
        self._serving: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self._stop.set()
        if self._serving is not None:
            await self._serving

    def begin(self, options: RunOptions) -> None:
        """Follow the sensors of a run, unless it judges none, or that was begun."""
        if self._listener is None and options.alarms != NEVER:
            listener = HealthListener(options, self._report_news, self._past)
            self._listener = listener
            serving = listener.serve(self._stop)
            self._serving = asyncio.create_task(serving, name="watch/health")

    def receive(self, message: wire.Observation, sent: int) -> None:
        """Receive what was read, and when it was sent."""
        if self._listener is not None:
            self._listener.receive(message, sent)

    def _report_news(self, standing: Standing) -> None:
        before, self._last = self._last, standing
        for each in news(before, standing):
            self._report(each)


def _changes(decision: wire.Decision, births: Births) -> Iterator[Changed]:
    """Yield what a decision grew and retired.

    What was grown before anybody looked on is known from the next key-frame on; until
    then a sensor that is grown has its formula alone.
    """
    if decision.born < births.body.size:
        yield from changes_in(decision, births.body)
        return
    body = births.first.grow(context_in(decision))
    yield Changed(decision.tick, decision.born, body.sensors[body.first_grown])
