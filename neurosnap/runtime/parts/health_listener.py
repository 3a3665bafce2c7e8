"""Follows the health of a run's sensors, on another thread."""

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import NamedTuple, Self

from neurosnap import wire
from neurosnap.errors import NeurosnapError
from neurosnap.health.alarm import Standing
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recorded_readings import (
    OwnReadings,
    observations,
    own_readings,
)
from neurosnap.recording.read.recording import Recording, first_path
from neurosnap.sources.open import is_live

_LOOK = 60.0
"""Seconds without a reading after which it looks at the clock."""
_LATE = 60.0
"""Seconds that a reading may be under way. By as much what is said of silence is late:
who reads the recording then finds each reading in the same step."""
_LAST = 10.0
"""Seconds it may take to end."""
_logger = logging.getLogger(__name__)


class Past(NamedTuple):
    """The recorded readings of the time before a run was resumed."""

    log: Path
    """The recording; of several files the first."""
    until: int | None = None
    """The last tick that counts; None if all of it does."""

    @classmethod
    def of(cls, past: ResumePoint) -> Self:
        """Return the past of a run that is resumed."""
        return cls(first_path(Path(past.log), past.part), past.tick)


class HealthListener:
    """Reports which sensors of a run seem broken.

    It keeps no state: after a restart it reads again what is recorded.

    Args:
        options: Of the run; the world's own sensors are judged, by its budget.
        report: Called with the health of the sensors when that is new, on the loop.
        past: A recording of what was read before; None if nothing was.
    """

    def __init__(
        self,
        options: RunOptions,
        report: Callable[[Standing], None],
        past: Past | None = None,
    ) -> None:
        self._body = options.body
        self._follower = options.follower()
        self._report = report
        self._past = past
        self._reported: Standing | None = None
        self._tick = 0  # the last that was followed
        self._is_live = is_live(options.source)  # else silence means nothing
        self._waiting: SimpleQueue[tuple[int, OwnReadings] | None] = SimpleQueue()

    def receive(self, message: wire.Observation, sent: int) -> None:
        """Receive an observation, sent so many nanoseconds after 1970; does not wait.

        One of a tick that was there before, or is done again, counts for nothing.

        Raises:
            ShapeError: It is of another number of sensors.
        """
        observed = own_readings(message, sent, self._body)
        self._waiting.put((message.tick, observed))

    async def serve(self, stop: asyncio.Event) -> None:
        """Follow what was received until `stop` is set, and then to its end.

        To learn anew takes seconds, sometimes, so this is done on a thread. One that is
        learning at the end is not waited for.
        """
        loop = asyncio.get_running_loop()
        over: Future[None] = Future()

        def work() -> None:
            with suppress(
                RuntimeError
            ):  # the loop is closed, so nothing waits any more
                try:
                    self._follow(
                        lambda now: loop.call_soon_threadsafe(self._report, now)
                    )
                    over.set_result(None)
                except Exception as error:  # noqa: BLE001 - raised where it is awaited
                    over.set_exception(error)

        threading.Thread(target=work, name="health", daemon=True).start()
        following = asyncio.wrap_future(over)
        stopping = asyncio.create_task(stop.wait(), name="health/stop")
        try:
            await asyncio.wait(
                (following, stopping), return_when=asyncio.FIRST_COMPLETED
            )
            self._waiting.put(None)
            await asyncio.wait((following,), timeout=_LAST)
            if following.done():
                following.result()
        finally:
            stopping.cancel()
            self._waiting.put(None)

    def _follow(self, report: Callable[[Standing], object]) -> None:
        if self._past is not None:
            self._catch_up(self._past)
            self._report_new(report)
        while True:
            try:
                observed = self._waiting.get(timeout=_LOOK)
            except Empty:
                if self._is_live:
                    self._follower.until(time.time() - _LATE)
            else:
                if observed is None:
                    return
                self._observe(*observed)
            self._report_new(report)

    def _observe(self, tick: int, observed: OwnReadings) -> None:
        if tick > self._tick:
            self._tick = tick
            at, on, known, begins, said = observed
            self._follower.observe(on, known, at, begins=begins, said=said)

    def _catch_up(self, past: Past) -> None:
        """Follow what is recorded by now. A millisecond or so for each ten minutes."""
        try:
            for tick, observed in observations(Recording.open(past.log)):
                if past.until is not None and tick > past.until:
                    break
                self._observe(tick, observed)
        except (NeurosnapError, OSError) as error:
            _logger.warning("health: learned from a part of the recording: %s", error)

    def _report_new(self, report: Callable[[Standing], object]) -> None:
        """Report the health of the sensors if it has changed."""
        now, last = self._follower.standing, self._reported
        if last is None or (now.alarms, now.progress) != (last.alarms, last.progress):
            self._reported = now
            report(now)
