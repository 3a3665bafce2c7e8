"""A recording: the files of one run, in order, as one list of chunks.

The first file keeps the name that was asked for; the others are called after it and
numbered, ``run.mcap``, ``run_0001.mcap``, so that they are listed in order. Each begins
with a key-frame and is a recording by itself. A run that was split, one that still
grows and one that was damaged differ only in how the list of its chunks comes about.

One that was cut short (by a crash, a full disk, a lost machine) is read to its last
whole chunk, and `Recording.cut` says so; `Recording.damage` says what cannot be read,
and `Recording.whole` that nothing is missing. To derive anything one must know where
messages are missing: see `neurosnap.recording.read.stretches`.
"""

import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, pairwise
from pathlib import Path
from typing import Self

import msgspec
from mcap.opcode import Opcode

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.chunk_index import find_record
from neurosnap.recording.format.completeness import (
    Completeness,
    RunningNumbers,
    added_up,
)
from neurosnap.recording.format.cuts_and_damage import scan_growth
from neurosnap.recording.format.records import CLOSING, Chunk, Cut, Layout, opened
from neurosnap.recording.read.chunk_messages import M, Recorded, decoded
from neurosnap.recording.read.recording_file import Noted, RecordingFile, identity


def part_path(log: Path, number: int) -> Path:
    """Return the path of a file of the run that is recorded at `log`.

    Examples:
        >>> part_path(Path("run.mcap"), 2).name
        'run_0002.mcap'
    """
    return log if number == 0 else log.with_name(f"{log.stem}_{number:04d}{log.suffix}")


def first_path(path: Path, number: int | None) -> Path:
    """Return the path of the first file, by that of another or of the only one."""
    if not number:
        return path
    return path.with_name(f"{path.stem.removesuffix(f'_{number:04d}')}{path.suffix}")


def part_paths(log: Path) -> dict[int, Path]:
    """Return the files there are of the run that is recorded at `log`, by number."""
    name = re.compile(rf"{re.escape(log.stem)}_(\d{{4,9}}){re.escape(log.suffix)}")
    found = {0: log} if log.exists() else {}
    if log.parent.is_dir():
        for path in log.parent.iterdir():
            if (match := name.fullmatch(path.name)) and int(match[1]):
                found[int(match[1])] = path
    return dict(sorted(found.items()))


def has_only_begun(path: Path) -> bool:
    """Tell whether a file was cut before the end of its first message, or is zeros.

    Raises:
        RecordingError: It cannot be read.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        return find_record(path, file, layout, 0, only=(Opcode.CHUNK,)) is None


def begun(paths: Mapping[int, Path]) -> tuple[str, ...]:
    """Return which of several files of a run was begun and got no further: the last."""
    last = paths.get(max(paths, default=0))
    with suppress(RecordingError):
        if len(paths) > 1 and last is not None and has_only_begun(last):
            return (f"{last}: begun, nothing in it",)
    return ()


class Recording:
    """The files of one run that are there, in order; none is held open between reads.

    Args:
        files: One or more.
        unread: Why others cannot be read.
        log: Where the run is recorded; None for the path of the first file.

    Raises:
        RecordingError: They are not of one run; from what looks at them: they cannot
            be read, or say what no writer writes.
    """

    def __init__(
        self,
        files: Sequence[RecordingFile],
        unread: Sequence[str] = (),
        log: Path | None = None,
    ) -> None:
        self.files = tuple(files)
        self.unread = tuple(unread)
        self.path = files[0].path
        self._log = self.path if log is None else log
        # Before another file of that name may come.
        self._identities = {file.path: identity(file.path) for file in files}
        for file in files if len(files) > 1 else ():
            options = file.metadata.get("options")
            if file.part is None or options != self.metadata.get("options"):
                rule = f"must be of the run of {self.path}"
                raise RecordingError(f"{file.path}: {rule}, got another")
        self._count()

    @classmethod
    def open(cls, log: Path | str, *, verify: bool = True) -> Self:
        """Open what was recorded at `log`, be it one file or several.

        Args:
            log: The only file, or the first, for all there are; the first may have been
                deleted. A later one stands for itself.
            verify: As in `RecordingFile.open`.

        Raises:
            RecordingError: No file can be read, or is a recording of ours; or they are
                not of one run.
        """
        log = Path(log)
        paths = part_paths(log)
        blank = begun(paths)
        files: list[RecordingFile] = []
        unread: list[RecordingError] = []
        for path in list(paths.values())[: len(paths) - len(blank)]:
            try:
                file = RecordingFile.open(path, verify=verify)
            except RecordingError as error:
                unread.append(error)
                continue
            if path == log and (file.part != 0 or len(paths) == 1):
                return cls([file])
            files.append(file)
        if unread and not files:
            raise unread[0]
        if not files:
            return cls.open_file(log)  # which says why not
        return cls(files, (*map(str, unread), *blank), log)

    @classmethod
    def open_file(cls, path: Path | str) -> Self:
        """Open one file, whatever others there are of its run.

        Raises:
            RecordingError: As from `open`.
        """
        return cls([RecordingFile.open(Path(path))])

    def _count(self) -> None:
        self.chunks: list[tuple[RecordingFile, Chunk]] = [
            (file, chunk) for file in self.files for chunk in file.layout.chunks
        ]

    @property
    def _last(self) -> RecordingFile:
        """The last file, which knows best how often the run was taken up again."""
        return self.files[-1]

    @property
    def metadata(self) -> dict[str, str]:
        """What was written of the run at its start; empty if it was cut before that."""
        return self._last.metadata

    @property
    def options(self) -> RunOptions:
        """The options that the run was made with."""
        where, rule = f"{self.path}: options", "must be those of a run"
        return decoded(self.metadata.get("options"), RunOptions, where, rule)

    @property
    def resumed(self) -> tuple[int, ...]:
        """The ticks after which the run was resumed."""
        where, rule = f"{self.path}: resumed", "must be a list of ticks"
        said = self.metadata.get("resumed", "[]")
        return decoded(said, tuple[int, ...], where, rule)

    @property
    def part(self) -> int | None:
        """Which file of its run the first is, from 0; None if it is not split."""
        return self.files[0].part

    @property
    def begins(self) -> int:
        """The tick of the key-frame it begins with; 0 if it begins with the run."""
        return self.files[0].begins

    @property
    def swarm(self) -> str:
        """The id of the swarm that was recorded."""
        return self.metadata.get("swarm", "recorded")

    @property
    def totals(self) -> dict[str, str] | None:
        """What was written at the end; None if the recording did not get there."""
        return self._last.totals

    @property
    def closing(self) -> wire.Decision | None:
        """The decision of the last tick, where that opens another file; else None."""
        noted = (self.totals or {}).get(CLOSING)
        if noted is None:
            return None
        where = f"{self._last.path}: {CLOSING}"
        return decoded(noted, wire.Decision, where, "must hold a decision")

    @property
    def cut(self) -> Cut | None:
        """Where the first file was cut that has no end; None if all have one."""
        return next((file.cut for file in self.files if file.cut is not None), None)

    @property
    def damage(self) -> tuple[str, ...]:
        """What cannot be read or is known to be missing, a line each; empty if nothing.

        That the last file was cut short is not in here, nor what was lost on the way to
        it. A file that another one follows and that has no end lacks it.
        """
        lines = [*self.unread]
        lines += chain.from_iterable(file.damage for file in self.files)
        for before, after in pairwise(self.files):
            if (cut := before.cut) is not None:
                place = f"byte {cut.offset} of {cut.size}"
                lines.append(f"{before.path}: cut short at {place}")
            if after.part != (before.part or 0) + 1:
                lines.append(f"{after.path}: the file before it is missing")
        return tuple(lines)

    @property
    def spoiled(self) -> bool:
        """Some bytes of its files cannot be read, however much they still grow."""
        return any(file.damage for file in self.files)

    @property
    def lost(self) -> tuple[str, ...]:
        """`damage`, and where the last file was cut short; empty if nothing is lost."""
        last = self.files[-1]
        if (cut := last.cut) is None:
            return self.damage
        place = f"after {cut.chunks} whole chunks, at byte {cut.offset} of {cut.size}"
        return (*self.damage, f"{last.path}: cut short {place}")

    @property
    def whole(self) -> bool:
        """Its files have their end and no damage, and no message is missing."""
        return (
            all(file.whole for file in self.files)
            and not self.damage
            and self.noted().completeness.whole
        )

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int = 0,
    ) -> Iterator[Recorded]:
        """Return the messages of all files; see `RecordingFile.messages`."""
        several = []
        for file in self.files:
            several.append(file.messages(topics, start=start))
            start = 0 if any(c.end >= start for c in file.layout.chunks) else start
        return chain.from_iterable(several)

    def all(self, topic: str, kind: type[M]) -> Iterator[M]:
        """Return the messages of a topic that are of one kind; see `messages`."""
        several = (recorded.message for recorded in self.messages((topic,)))
        return (message for message in several if isinstance(message, kind))

    def blank_sequences(self) -> RunningNumbers:
        """Return the senders' running numbers before any message has come."""
        share = self.files[0].share
        return RunningNumbers(share or {}, anywhere=share is None)

    def sequences(self) -> RunningNumbers:
        """Read all messages and return every sender's running numbers."""
        sequences = self.blank_sequences()
        for recorded in self.messages():
            sequences.receive(recorded.message.sender, recorded.sequence)
        return sequences

    def balance(self, sequences: RunningNumbers) -> Completeness:
        """Return whether any message is missing, by the running numbers of all.

        In a finished recording that includes what senders say they sent after the last
        that was recorded, and counts what the writer left out.
        """
        noted = self.noted()
        balance = sequences.completeness(
            noted.expected, foreign=noted.completeness.foreign
        )
        duplicates = balance.duplicates + noted.completeness.duplicates
        gaps = sum(len(file.layout.gaps) for file in self.files)
        return msgspec.structs.replace(balance, duplicates=duplicates, gaps=gaps)

    def noted(self) -> Noted:
        """Return what the writers noted, added up; empty if they did not get there.

        What one file ends before and the next begins after is missing.
        """
        noted = [file.noted() for file in self.files]
        between = Completeness(0, dict(self._between(noted)))
        balances = (each.completeness for each in noted)
        return Noted(added_up([between, *balances]), noted[-1].expected)

    def _between(self, noted: Sequence[Noted]) -> Iterator[tuple[str, int]]:
        lost: dict[str, int] = {}
        both = zip(pairwise(self.files), noted[:-1], strict=True)
        for (before, after), ended in both:
            if before.totals is None or after.share is None:
                continue
            for who, first in after.share.items():
                gap = first - ended.expected.get(who, 0)
                lost[who] = lost.get(who, 0) + max(0, gap)
        yield from ((who, count) for who, count in lost.items() if count)

    def grow(self) -> tuple[bool, bool]:
        """Look at what the files have gained, and for new ones.

        Returns:
            Whether that is anything, and whether chunks have other numbers since: a
            file is finished for a while yet after the next was begun.

        Raises:
            RecordingError: A file cannot be read.
        """
        dropped = self._drop_deleted()
        before = self.chunks
        # All of them, and not only up to the first that has grown.
        gains = [scan_growth(file.path, file.layout) for file in self.files]
        fresh = self._fresh() if self.part is not None else []
        self.files += tuple(fresh)
        self._identities |= {file.path: identity(file.path) for file in fresh}
        grown = dropped or any(gains) or bool(fresh)
        if grown:
            self._count()
        return grown, self.chunks[: len(before)] != before

    def _drop_deleted(self) -> bool:
        """Leave out files that were deleted from the beginning; return whether any."""
        there = tuple(file for file in self.files if file.path.exists())
        if self.part is None or not there or len(there) == len(self.files):
            return False
        self.files = there
        return True

    def _fresh(self) -> list[RecordingFile]:
        """Return the files that are new, as far as they have begun."""
        known = {file.path for file in self.files}
        fresh = []
        for path in part_paths(self._log).values():
            if path not in known:
                try:
                    if has_only_begun(path):
                        break
                    fresh.append(RecordingFile.open(path, verify=False))
                except RecordingError:
                    break  # it is looked at again
        read = tuple(f"{file.path}: " for file in fresh)
        self.unread = tuple(one for one in self.unread if not one.startswith(read))
        return fresh

    def replaced(self) -> bool:
        """Return whether a file is another now, or one is before those that were there.

        Raises:
            RecordingError: None is there.
        """
        paths = list(part_paths(self._log).values()) if self.part is not None else []
        first = paths[0] if paths else self.files[0].path
        known = {file.path: self._identities[file.path] for file in self.files}
        there = {first, *(path for path in known if path.exists())}
        return any(identity(path) != known.get(path) for path in there)
