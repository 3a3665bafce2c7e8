"""Splits a recording into files of limited size, each replayable by itself.

When a file has exceeded the size, the next key-frame begins another. The coordinator
sends a key-frame while no wave is in flight, so every message that belongs before it
was sent before it. Not all of them have arrived by then, since messages of different
senders overtake each other. So the older file stays open for a while, and takes each
sender's messages up to its first of a later wave or tick; one sender's messages arrive
in order, so no earlier one can follow. (Cells may still report on a wave that was given
up, but take part in no later wave before they know which waves are over.) A message
without wave and tick (`fault`, `leave`) goes to the file of its sender's previous
message. Each file thus holds one range of a sender's sequence numbers, and is whole if
no number of that range is missing.

Other messages arrive before a message of the coordinator that they answer: the start
of their wave, or the decision before their tick. They are held back until it arrives.

If a sender's first message for the newer file does not come within `LATE` after the
key-frame, the older file is closed, and later messages of that sender go to the newer
file. If the recording ends earlier, the older file gets no end, unless the sender's
`leave` shows that it lacks nothing. Messages missing between a sender's last in the
older file and its first in the newer one count as missing from the older.

The decision of a file's last tick follows the key-frame, so it is in the next file. The
key-frame says it, too, and it is noted among the totals of the file before, which can
be verified to its end alone.

A closed file is finished at once, so that it survives the end of this process; the
sync to disk is done by `neurosnap.recording.write.fsync_thread`.
"""

import contextlib
import logging
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, Self

import msgspec

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.recording.format.completeness import Completeness, added_up
from neurosnap.recording.format.records import CLOSING
from neurosnap.recording.read.recording import part_path, part_paths
from neurosnap.recording.write.causal_order import (
    Arrival,
    CausalOrder,
    CoordinatorProgress,
)
from neurosnap.recording.write.copying import take_over
from neurosnap.recording.write.fsync_thread import FsyncThread
from neurosnap.recording.write.writer import Writer

_log = logging.getLogger(__name__)
LATE = 2 * 10**9
"""Nanoseconds that a file stays open for what was sent before the next one began, and
that a message waits for the word it answers."""


class Split(msgspec.Struct, frozen=True):
    """How a recording is spread over files."""

    size: int
    """Bytes after which the next key-frame begins another file. It has more than that
    by what is recorded from one key-frame to the next."""
    keep: int = 0
    """How many of them are kept, the newest; 0: all."""


class _Boundary(NamedTuple):
    """Where the newest file begins."""

    decision: wire.Decision
    """That of the key-frame's tick."""
    wave: int
    closes: int
    """The log time after which earlier messages are no longer waited for."""


class SplitWriter:
    """Writes a recording, in one file or in several; see `Writer`.

    Args:
        log: Where to write; the further files are called after it.
        metadata: What to write of the run into each of them.
        past: What the recording takes over, for a run that is resumed.
        split: How to spread it over files; None if it is one.
        sync_every: Seconds between two calls of `sync` that the run wants; 0: none.
        new_writer: Makes a file.
        senders: The parts of the run: what another says is foreign, so that it makes no
            recording incomplete. Empty: all.

    Raises:
        RecordingError: A file exists already, or cannot be made.
    """

    def __init__(
        self,
        log: Path | str,
        metadata: Mapping[str, str],
        past: ResumePoint | None = None,
        *,
        split: Split | None = None,
        sync_every: float = 0.0,
        new_writer: Callable[[Path], Writer] = Writer,
        senders: Collection[str] = (),
    ) -> None:
        self._log = Path(log)
        self._split = split
        self.sync_every = sync_every
        self._make = new_writer
        self._senders = frozenset(senders)
        self._number = 0 if past is None else past.part
        self._begins = 0 if past is None else past.begins
        self._metadata = dict(metadata)
        if past is not None:
            self._metadata["resumed"] = msgspec.json.encode(past.resumed).decode()
        self._check_free()
        self._older: Writer | None = None
        self._boundary = _Boundary(wire.Decision(0, -1, ""), 0, 0)
        self._causes = CausalOrder(LATE)
        self._passed: set[str] = set()  # whose messages go to the newest file
        self._closed: list[Completeness] = []
        self._saving = FsyncThread()
        self._recent: OrderedDict[tuple[str, int], int] = OrderedDict()
        self._harmed: list[str] = []
        self._newest = self._new_writer()
        try:
            self._newest.start(self._facts())
            if past is not None:
                take_over(self._newest, past)
        except BaseException:
            self.abandon()
            raise

    def _check_free(self) -> None:
        """Refuse to start if a later file of the split exists already."""
        for number, path in part_paths(self._log).items():
            if self._split is not None and number > self._number:
                rule = "must not exist yet"
                raise RecordingError(f"log: {rule}, got {str(path)!r}")

    def _new_writer(self) -> Writer:
        writer = self._make(part_path(self._log, self._number))
        writer.recent = self._recent  # a message may come again to another file
        return writer

    def _facts(self) -> dict[str, str]:
        """Return what is written of the run at the start of the newest file."""
        if self._split is None:
            return self._metadata
        part = {"part": str(self._number), "begins": str(self._begins)}
        return {**self._metadata, **part}

    def upcoming(self, sender: str) -> int:
        """Return the number after the highest that came from `sender`."""
        known = [
            self._newest.sequences.upcoming(sender),
            self._causes.upcoming(sender),
        ]
        if self._older is not None and sender not in self._passed:
            known.append(self._older.sequences.upcoming(sender))
        return max(known)

    def add(self, delivery: wire.Delivery, log_time: int) -> wire.Message | None:
        """Write one message into the file it belongs to; see `Writer.add`.

        Returns:
            The message; None if it is foreign, and left out.

        Raises:
            RecordingError: The disk does not take what it is given, or a file exists
                already where the next one has to be.
        """
        message = self._newest.read(delivery)
        if message is None:
            return None
        if self._senders and message.sender not in self._senders:
            self._newest.foreign += 1
            return None
        if self._split is None:
            return self._newest.add(delivery, log_time, message)
        self._write_all(self._causes.add(Arrival(message, delivery, log_time)))
        return message

    def _write_all(self, several: Iterable[Arrival]) -> None:
        for heard in several:
            self._write(*heard)

    def _write(
        self, message: wire.Message, delivery: wire.Delivery, log_time: int
    ) -> None:
        """Write one message into the file it belongs to."""
        if isinstance(message, wire.KeyFrame) and self._is_full(message, delivery):
            self._begin(message, delivery, log_time)
        if self._older is not None:
            if log_time > self._boundary.closes:
                self._close()
            elif self._belongs_before(message, delivery.sequence, self._older):
                self._older.add(delivery, log_time, message)
                return
        self._newest.add(delivery, log_time, message)

    def _is_full(self, frame: wire.KeyFrame, delivery: wire.Delivery) -> bool:
        """Tell whether a key-frame is to begin another file.

        Not if it is a duplicate; if the newest file begins with its tick, since the
        file of a resumed run still has to receive it; or if its tick's decision is
        recorded already, as at the end of a run.
        """
        return (
            self._split is not None
            and (self._newest.size > self._split.size or bool(self._newest.harm))
            and frame.tick > self._begins
            and frame.tick >= self._causes.asked
            and delivery.sequence >= self.upcoming(frame.sender)
        )

    def _begin(
        self, frame: wire.KeyFrame, delivery: wire.Delivery, log_time: int
    ) -> None:
        """Let a key-frame begin the next file."""
        self._close()
        self._older = self._newest
        self._number += 1
        self._begins = frame.tick
        self._newest = self._new_writer()
        self._newest.start(self._facts())
        decision = wire.Decision(frame.tick, frame.action, frame.why)
        self._boundary = _Boundary(decision, frame.waves, log_time + LATE)
        self._passed = set()
        self._pass(frame.sender, delivery.sequence, self._older)

    def _belongs_before(
        self, message: wire.Message, sequence: int, older: Writer
    ) -> bool:
        """Tell whether a message belongs into the older file; let its sender pass."""
        sender = message.sender
        if sender in self._passed:
            return False
        tick, wave = self._boundary.decision.tick, self._boundary.wave
        # The newest file begins with the key-frame of the tick, and its bands.
        said = CoordinatorProgress(
            tick, wave, (tick + 1, 0), learn=tick, frame=tick - 1
        )
        if not said.is_before(message):
            return True
        self._pass(sender, sequence, older)
        if self._passed >= older.sequences.first.keys():
            self._close()
        return False

    def _pass(self, sender: str, sequence: int, older: Writer) -> None:
        """From here on a sender's messages go to the newest file.

        Messages lost between its last in the older file and this one count as missing
        from the older file: they may be its end, and the newest is read without it.
        """
        self._passed.add(sender)
        first = max(sequence, older.sequences.upcoming(sender))
        self._newest.sequences.begin(sender, first)

    def _close(self, expected: Mapping[str, int] = MappingProxyType({})) -> None:
        """Finish the older file, if one is open, and let it be saved.

        Args:
            expected: How many messages each sender must have sent in all. If the older
                file lacks some of a sender that sent nothing since the newer one began,
                it gets no end, and no run resumes from the newer file.
        """
        if self._older is None:
            return
        self._saving.wait()  # may raise, so it comes before `_older` is cleared
        older, self._older = self._older, None
        self._watch(older)
        begun = self._newest.sequences.first
        ends = {
            sender: begun.get(sender, older.sequences.upcoming(sender))
            for sender in older.sequences.first.keys() | self._passed
        }
        silent = ends.keys() - self._passed
        is_whole = all(expected.get(sender, 0) <= ends[sender] for sender in silent)
        for sender, end in ends.items():
            self._newest.sequences.begin(sender, end)
        # Written first: a run that resumes from the newest file needs it.
        self._newest.write_share()
        if not is_whole:
            older.abandon()
            self._closed.append(older.balance(ends))
            return
        closing = self._boundary.decision
        totals = {
            "ticks": str(closing.tick),
            CLOSING: wire.encode(closing).decode(),
        }
        self._closed.append(older.finish(totals, ends, saves=False))
        self._saving.save(older, partial(self._after, older, self._not_kept()))

    def _after(self, saved: Writer, not_kept: Iterable[Path]) -> None:
        """Delete files, as a newer one is on the disk now. On the thread that saves."""
        self._watch(saved)
        _delete(not_kept)

    def _not_kept(self) -> list[Path]:
        """Return the files there are that are not among the newest."""
        if self._split is None or not self._split.keep:
            return []
        oldest = self._number - self._split.keep
        return [path for n, path in part_paths(self._log).items() if n <= oldest]

    def flush(self, now: int) -> None:
        """Flush what was written to the operating system; see `Writer.flush`.

        What waits for longer than `LATE` at `now`, by the clock of `add`, goes along.

        Raises:
            RecordingError: Also where a file that was closed before cannot be saved.
        """
        self._saving.check()
        self._write_all(self._causes.due(now))
        for file in self._files():
            file.flush()
            self._watch(file)

    def _files(self) -> list[Writer]:
        """Return the files that are written to."""
        return [file for file in (self._older, self._newest) if file is not None]

    def _watch(self, file: Writer) -> None:
        """Say once of a file that it is not where it was, or not as it was written."""
        path, harm = str(file.path), file.harm
        if harm and path not in self._harmed:
            self._harmed.append(path)
            rule = "must stay where and as it is while it is written"
            _log.error("log: %s, got %s: %r", rule, harm, path)

    def read_back(self) -> bool:
        """Read what was written since the last time; tell if no file was harmed yet."""
        for file in self._files():
            file.file.read_back()
            self._watch(file)
        return self._saving.check() and not self._harmed

    def sync(self) -> bool:
        """Sync flushed data to disk, on a thread; false while another is under way.

        Raises:
            RecordingError: Now or before the disk did not take it.
        """
        return self._saving.sync(self._files())

    def finish(
        self, totals: Mapping[str, str], expected: Mapping[str, int]
    ) -> Completeness:
        """Finish all files, see `Writer.finish`; return what they hold, added up."""
        self._write_all(self._causes.rest())
        self._close(expected)
        self._saving.close()
        self._watch(self._newest)
        balances = [*self._closed, self._newest.finish(totals, expected)]
        self._watch(self._newest)
        vanished = tuple(self._harmed)
        return msgspec.structs.replace(added_up(balances), vanished=vanished)

    def give_up(self, expected: Mapping[str, int]) -> Completeness:
        """Close after an error of the disk; return what the files hold, at most."""
        files = self._files()
        with contextlib.suppress(RecordingError):
            self.abandon()
        balances = [*self._closed, *(file.balance(expected) for file in files)]
        vanished = {*self._harmed, *(str(file.path) for file in files)}
        return msgspec.structs.replace(added_up(balances), vanished=(*vanished,))

    def abandon(self) -> None:
        """Close without totals and index; see `Writer.abandon`."""
        files = [file for file in (self._newest, self._older) if file is not None]
        with contextlib.ExitStack() as stack:
            stack.callback(self._saving.close)
            for file in files:
                stack.callback(file.abandon)
            if all(file.is_open for file in files):
                self._write_all(self._causes.rest())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.abandon()


def _delete(paths: Iterable[Path]) -> None:
    """Delete files; what is gone already is none."""
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            rule = "files that are not kept must be deletable"
            got = f"{error.strerror} for {str(path)!r}"
            raise RecordingError(f"keep: {rule}, got {got}") from error
