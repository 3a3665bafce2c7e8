"""The files of a restarted run: what may be deleted, and what is kept.

No file that holds ticks is deleted or written over, unless each of its ticks was read
back from other files, which are not written to any more and which the disk has. What
cannot be read to its end is never deleted: it may hold ticks.

A run that goes on copies the last file that it can go on from. That file is called
``NAME.broken`` meanwhile, and goes once the new one holds its ticks. What cannot be
gone on from is kept as ``NAME.damaged-1.mcap``, or the next number that is free. Every
step is a rename or a deletion, so that a launcher killed between two of them leaves all
ticks in files with one of these names, or in the recording itself.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TypeAlias

import msgspec

from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.records import CHUNK_HEAD, HEAD, MAGIC
from neurosnap.recording.read.recording import Recording, part_path, part_paths
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.find_resume_point import find_resume_point, whole_ticks
from neurosnap.runtime.recorded_source import recordable
from neurosnap.system.durable import sync_file, sync_folder

_Tick: TypeAlias = tuple[int, bytes, bytes, bool]
_LEAST = len(MAGIC) + HEAD.size + CHUNK_HEAD.size
"""Bytes without which there is no chunk."""
# A chunk of less than 4 GiB: its length, times, size, checksum, compression, and bytes.
_CHUNK = re.compile(
    rb"(?=\x06(.{4})\0{4}.{28}(\x04\0{3}zstd|\0{4})(.{4})\0{4})", re.DOTALL
)


class RestartFiles:
    """The files of one run over the restarts of its swarm.

    Args:
        log: The recording; of several files the first.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        self._broken = log.with_name(f"{log.name}.broken")
        self.kept: dict[Path, int] = {}
        """What is not known to be all in the recording, and the tick that was gone on
        from; 0 if none was."""
        self.unread: list[Path] = []
        """Files of the recording that are damaged, and that it goes on without."""

    def check_free(self) -> None:
        """Raise InvalidValueError if a killed run left files; it says how to go on."""
        if self._broken.exists():
            rule = (
                "must be taken away first: a run left it that was cut short; go on"
                " from it, or from its recording if that got further, with `neurosnap"
                " resume FILE --out NEW`"
            )
            raise InvalidValueError("log", rule, str(self._broken))

    def furthest(self, options: RunOptions) -> ResumePoint | None:
        """Return where the recorded run can go on; None if it has no whole tick.

        Of several files, one that is damaged may be skipped: then the last is taken
        that can be gone on from alone.

        Args:
            options: The run's. It goes on from no later tick than the one before its
                last: with that done again, it ends as it should.
        """
        paths = part_paths(self._log)
        later = [path for number, path in paths.items() if number]
        for path in (self._log, *reversed(later)):
            try:
                recorded, found = find_resume_point(path, options.ticks - 1)
            except RecordingError:
                continue
            if recorded != recordable(options):
                continue  # a cut file has no checksum for what it says of its run
            before = [each for number, each in paths.items() if number < found.part]
            self.unread = [each for each in before if not _is_sound(each)]
            return found
        self.unread = []
        return None

    def go_on(
        self, found: ResumePoint | None, before: ResumePoint | None
    ) -> tuple[bool, ResumePoint | None]:
        """Make room for the recording of the next life.

        Args:
            found: From `furthest`.
            before: Where the life that ended had gone on from.

        Returns:
            Whether the run got further than it had, and where it goes on.

        Raises:
            OSError: A file cannot be moved, or the disk does not take it.
        """
        if found is None or (before is not None and found.tick <= before.tick):
            first = 0 if before is None else before.part
            self._clear(first, [] if before is None else [Path(before.log)])
            return False, before
        base = Path(found.log)
        self._clear(found.part + 1, [base])
        if self._broken.exists():
            tick = 0 if before is None else before.tick
            self._discard(self._broken, self._files(_number(self._broken)), tick)
        sync_file(base)
        base.rename(self._broken)
        sync_folder(base.parent)
        return True, msgspec.structs.replace(found, log=str(self._broken))

    def have_left(self, tick: int) -> bool:
        """Tell whether a file of an earlier life holds a tick, as it was observed.

        Args:
            tick: Where it was cut off, so that the next life does it again.
        """
        left = [self._broken] if self._broken.exists() else []
        with suppress(RecordingError, OSError):
            return any(one[0] == tick for one in _ticks([*left, *self.kept]))
        return False

    def finish(self) -> None:
        """Delete what the recording holds all of, once it has its end.

        Raises:
            OSError: A file cannot be moved or deleted.
        """
        if not part_paths(self._log):
            return  # it was taken away
        if self._broken.exists():
            self._discard(self._broken, self._files(_number(self._broken)))
        for path in list(self.kept):
            if _deleted(path, self._files(_number(path))):
                del self.kept[path]

    def keep_furthest(self) -> None:
        """Keep as the recording the one of two that has more whole ticks.

        Of a run in several files, ``NAME.broken`` is one of them, and goes back to its
        place. Blocks for as long as it takes to derive the last ticks of both again.
        Where there is no such file, nothing is done.
        """
        if not self._broken.exists():
            return
        number = _number(self._broken)
        after, before = whole_ticks(self._log), whole_ticks(self._broken)
        if after and after >= before:
            self._discard(self._broken, self._files(number))
            return
        self._clear(number, [self._broken])
        self._broken.rename(part_path(self._log, number))

    def _files(self, first: int) -> list[Path]:
        """Return the files of the recording from number `first` on."""
        paths = part_paths(self._log).items()
        return [path for number, path in paths if number >= first]

    def _clear(self, first: int, held_by: Sequence[Path]) -> None:
        """Move the files of the recording from number `first` on out of the way."""
        for path in self._files(first):
            self._discard(path, held_by)

    def _discard(self, path: Path, held_by: Sequence[Path], tick: int = 0) -> None:
        """Delete a file if others hold its ticks; otherwise keep it beside."""
        if _deleted(path, held_by):
            return
        kept = self._free_name()
        path.rename(kept)
        sync_folder(kept.parent)
        self.kept[kept] = tick

    def _free_name(self) -> Path:
        """Return where the next thing is kept that cannot be gone on from."""
        stem, suffix = self._log.stem, self._log.suffix
        names = (f"{stem}.damaged-{number}{suffix}" for number in count(1))
        paths = map(self._log.with_name, names)
        return next(path for path in paths if not path.exists())


def _deleted(path: Path, held_by: Sequence[Path]) -> bool:
    """Delete a file if others hold all of its ticks; tell whether they do."""
    try:
        if path.stat().st_size > _LEAST and not _hold(held_by, path):
            return False
    except RecordingError:  # it cannot be read, or they cannot
        return False
    for other in held_by:
        sync_file(other)
    path.unlink()
    return True


def _hold(files: Sequence[Path], path: Path) -> bool:
    """Tell whether files hold every whole tick of another one, as it was observed."""
    held = _ticks(files)
    return _is_sound(path) and all(tick in held for tick in _ticks([path]))  # in order


def _is_sound(path: Path) -> bool:
    """Tell whether a file can be read to its end, or to where it was cut."""
    try:
        recording = Recording.open_file(path)
        cut = recording.cut
        if recording.damage:
            return False
        return cut is None or not _has_chunk(path, cut.offset)
    except RecordingError:
        return False


def _ticks(files: Sequence[Path]) -> Iterator[_Tick]:
    """Yield the ticks that have an observation and a state, in order."""
    for path in files:
        for tick in ticks(Recording.open_file(path)):
            if tick.observation is not None and tick.state is not None:
                seen = tick.observation
                yield tick.number, seen.bits, seen.known, seen.begins


def _has_chunk(path: Path, offset: int) -> bool:
    """Tell whether there is a chunk behind the place where a file seems to be cut.

    Then it is no cut: a length before it is damaged. What is cut ends within a record.
    """
    with path.open("rb") as file:
        file.seek(offset)
        rest = file.read()
    for match in _CHUNK.finditer(rest):
        length, packed = (int.from_bytes(match[n], "little") for n in (1, 3))
        is_one = length == 32 + len(match[2]) - 4 + 8 + packed
        # The record that is cut is one that fits; behind it there must be none.
        if is_one == (match.start() > 0):
            return True
    return False


def _number(log: Path) -> int:
    """Return which of the files of its run one is; 0 where it does not say."""
    try:
        return Recording.open_file(log).part or 0
    except RecordingError:
        return 0
