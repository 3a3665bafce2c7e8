"""The recorder of a simulated swarm: writes real files, flushes without timers."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from neurosnap import wire
from neurosnap.errors import RecordingError, SwarmError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import describe
from tools.simulate.disk import Disk
from tools.simulate.simulated_faults import DECADES, Case


class _Writer(Writer):
    """Writes to a disk that may be full, and packs nothing.

    So a file is as long as what it holds says.
    """

    def __init__(
        self, check_space: Callable[[], None], path: Path, *, chunk: int
    ) -> None:
        super().__init__(path, packs=False, chunk=chunk)
        self._check_space = check_space

    def add(
        self,
        delivery: wire.Delivery,
        log_time: int,
        message: wire.Message | None = None,
    ) -> wire.Message | None:
        try:
            self._check_space()
        except OSError as error:
            raise self._failed(error) from error
        return super().add(delivery, log_time, message)


class Recorder:
    """Writes down what it hears, as `neurosnap.runtime.parts.recorder_process` does.

    Args:
        case: The run; its recording must not exist yet.
        past: What it takes over, where the run goes on from something.
        parts: Whose last word is awaited.
        chunk: Bytes after which a chunk is written.
        disk: What it writes to.
    """

    def __init__(
        self,
        case: Case,
        past: ResumePoint | None,
        parts: Collection[str],
        chunk: int,
        disk: Disk,
    ) -> None:
        self.failed = False
        self._disk, self._case = disk, case
        self._parts = parts
        self._left: set[str] = set()
        self._time = 2 * int(DECADES)
        facts = {**describe(case.options), "swarm": "simulated"}
        new_writer = partial(_Writer, disk.check_space, chunk=chunk)
        with self._failing():
            self._writer = SplitWriter(
                case.log, facts, past, split=case.split, new_writer=new_writer
            )

    def hear(self, deliveries: list[wire.Delivery]) -> None:
        """Write a burst down.

        Raises:
            SwarmError: The disk is full.
        """
        for delivery in deliveries:
            self._time += 1
            if self._case.chance.random() < self._case.weather.jump:
                self._time = self._case.chance.choice([1, 2, 3]) * int(DECADES)
                self._case.tally.jumps += 1
            with self._failing():
                message = self._writer.add(delivery, self._time)
            self._disk.truncate()
            if isinstance(message, wire.Leave):
                self._left.add(message.who)

    def finish(self) -> Completeness:
        """End the recording in order; return what it says of itself.

        Who has not said a last word lacks at least that.

        Raises:
            SwarmError: The disk is full.
        """
        upcoming = self._writer.upcoming
        ends = {who: upcoming(who) + (who not in self._left) for who in self._parts}
        with self._failing():
            return self._writer.finish({}, ends)

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """End the life of the swarm if the recorder cannot go on."""
        try:
            yield
        except RecordingError as error:
            self.failed = True
            raise SwarmError(f"recorder: {error}") from error

    def close(self) -> None:
        """Close the files, unless they are."""
        self._writer.abandon()
