"""The anomalies, births and alarms of a run, from its recording: whole, or growing."""

import asyncio
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

from neurosnap import wire
from neurosnap.agent.growth.changed import Changed
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.events import wait_at_most
from neurosnap.health.alarm import News, news
from neurosnap.health.budget import NEVER
from neurosnap.health.follower import Follower
from neurosnap.protocol.anomaly_words import (
    NamedAnomaly,
    named_anomaly,
    with_support,
)
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.observations import own_readings
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.births import Births
from neurosnap.runtime.parts.health_listener import LATE, SILENT_FOR
from neurosnap.runtime.registry import recorded_in

Fed: TypeAlias = NamedAnomaly | Changed | News

_LOOK = 0.25  # seconds between two looks at a recording that grows
_BETWEEN = 10.0  # seconds that one incarnation of a swarm may follow another by


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
    feed = _Feed(recording.options, support, recording.path)
    for each in recording.messages(feed.topics):
        yield from feed.receive(each)
    if recording.closing is not None:
        yield from feed.follow(recording.closing)


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


class _Feed:
    """Derives what is to be reported from the messages of a run, in their order.

    Args:
        options: The run's.
        support: As for `recorded`.
        path: The recording, for errors.
    """

    def __init__(self, options: RunOptions, support: int | None, path: Path) -> None:
        self._least = _support(options, support)
        self._path = path
        self._births = Births(options.body)
        self._changes: list[Changed] = []
        judged = options.alarms != NEVER
        self._follower = Follower(options.body.own, options.alarms) if judged else None
        self._standing = self._follower.standing if self._follower else None
        self.topics: tuple[str, ...] = ("anomaly",)
        """The topics of the messages that it needs."""
        if judged:
            self.topics += ("observation",)
        if options.body.room:
            self.topics += ("decision", "keyframe")

    def receive(self, recorded: Recorded) -> Iterator[Fed]:
        """Receive a message, and yield what follows from it."""
        match recorded.message:
            case wire.Observation() as seen if self._follower is not None:
                sensed = own_readings(seen, recorded.sent, self._births.first)
                at, on, known, begins = sensed
                self._follower.observe(on, known, at, begins=begins)
                yield from self._news()
            case wire.Anomaly() as anomaly:
                rest = with_support(anomaly, self._least)
                if rest is not None:
                    yield named_anomaly(rest, self._births.body.sensors)
            case wire.Decision() | wire.KeyFrame() as message:
                yield from self.follow(message)
            case _:
                pass

    def follow(self, message: wire.Decision | wire.KeyFrame) -> Iterator[Changed]:
        """Yield what a message shows to be grown or retired.

        Raises:
            RecordingError: A key-frame holds no agent of this run.
        """
        listed = self._births.listed
        try:
            self._births.follow(message)
        except ValueError as error:
            place = f"{self._path}: key-frame of tick {message.tick}"
            raise RecordingError(f"{place}: must hold an agent, {error}") from error
        if self._births.listed is not listed:
            before, self._changes = self._changes, self._births.changes()
            yield from (each for each in self._changes if each not in before)

    def pass_until(self, at: float) -> Iterator[News]:
        """Yield the alarms that follow where nothing was read until a time."""
        if self._follower is not None:
            self._follower.until(at)
            yield from self._news()

    def in_force(self) -> Iterator[News]:
        """Yield the alarms that there are now."""
        if self._standing is not None:
            yield from news(None, self._standing)

    def _news(self) -> Iterator[News]:
        if self._follower is not None and self._standing is not None:
            before, self._standing = self._standing, self._follower.standing
            yield from news(before, self._standing)


async def watch(
    log: Path,
    stop: asyncio.Event,
    report: Callable[[Fed], None],
    *,
    support: int | None = None,
    on_ready: Callable[[], None] = lambda: None,
) -> None:
    """Follow a recording that grows, until its run is over or `stop` is set.

    A run that goes on after a death is followed further. Alarms in force are reported
    at the beginning.

    Args:
        log: Where a swarm of this machine is recorded.
        stop: Ends it.
        report: Is given each anomaly, each sensor that is grown or retired, each alarm
            and its end.
        support: The occasions an anomaly must rest on; if None, what the run asks for.
        on_ready: Called once all that is recorded from now on will be reported.

    Raises:
        InvalidValueError: The run reports no anomalies and alarms, and grows nothing;
            or support is asked for, and the run does not count occasions.
    """
    growing = _Growing(log, support)
    for alarm in await asyncio.to_thread(growing.catch_up):
        report(alarm)
    on_ready()
    until = time.monotonic() + _BETWEEN
    while not stop.is_set():
        # Asked first: what was written before its end is seen after.
        runs = bool(recorded_in(log))
        for each in await asyncio.to_thread(growing.look):
            report(each)
        if runs:
            until = time.monotonic() + _BETWEEN
        elif growing.has_end or time.monotonic() > until:
            return
        await wait_at_most(stop, _LOOK)


class _Growing:
    """A recording that grows, and what is new in it. Used by one thread at a time."""

    def __init__(self, log: Path, support: int | None) -> None:
        self._log = log
        self._support = support
        self._recording: Recording | None = None
        self._seen: dict[Path, int] = {}  # chunks
        # The last tick that was seen, by kind of message: a run that goes on after a
        # death is recorded in a new file, which begins with what was seen.
        self._reached: dict[type[wire.Message], int] = {}
        self._silent_since = time.monotonic()

    @property
    def has_end(self) -> bool:
        """The last file that there is was finished."""
        return self._recording is not None and self._recording.totals is not None

    def catch_up(self) -> list[News]:
        """Pass over what is recorded by now; return the alarms in force."""
        self.look()
        return [] if self._recording is None else list(self._feed.in_force())

    def look(self) -> list[Fed]:
        """Return what is new.

        Raises:
            RecordingError: What is new is damaged, or not a run's.
        """
        found: list[Fed] = []
        try:
            if self._recording is None or self._recording.replaced():
                self._open()
            else:
                self._recording.grow()
            found.extend(self._new())
        except RecordingError:
            # Deleted; or the run, or what goes on with it, has not begun.
            if self._is_there():
                raise
        return found

    def _is_there(self) -> bool:
        """Return whether what was opened is what there is."""
        try:
            return self._recording is not None and not self._recording.replaced()
        except RecordingError:
            return False

    def _open(self) -> None:
        recording = Recording.open(self._log, verify=False)
        options = recording.options
        if not (options.watch or options.body.room or options.alarms != NEVER):
            rule = "must be run with --anomalies or --alarms"
            raise InvalidValueError("swarm", rule, recording.swarm)
        self._feed = _Feed(options, self._support, self._log)
        self._recording, self._seen = recording, {}

    def _new(self) -> Iterator[Fed]:
        for file in self._recording.files if self._recording is not None else ():
            chunks = file.layout.chunks
            for noted in chunks[self._seen.get(file.path, 0) :]:
                for each in file.chunk(noted).recorded(self._feed.topics):
                    yield from self._receive(each)
            self._seen[file.path] = len(chunks)
        now = time.monotonic()
        if now - self._silent_since >= SILENT_FOR:
            self._silent_since = now
            yield from self._feed.pass_until(time.time() - LATE)

    def _receive(self, recorded: Recorded) -> Iterator[Fed]:
        self._silent_since = time.monotonic()
        found, message = list(self._feed.receive(recorded)), recorded.message
        if isinstance(
            message, wire.Observation | wire.Anomaly | wire.Decision | wire.KeyFrame
        ):
            kind, tick = type(message), message.tick
            if tick > self._reached.get(kind, -1):
                self._reached[kind] = tick
                yield from found
