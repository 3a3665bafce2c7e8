"""Reads a split run's files as one recording.

The first file keeps the name that was asked for; the others are called after it and
numbered, ``run.mcap``, ``run_0001.mcap``, so that they are listed in order. Each begins
with a key-frame and is a recording by itself.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import chain, pairwise
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.recording.format.completeness import Completeness, added_up
from neurosnap.recording.format.messages import EVER
from neurosnap.recording.format.records import Cut
from neurosnap.recording.read.reader import Noted, Recorded, Recording


def part_path(log: Path, number: int) -> Path:
    """Return the path of a file of the run that is recorded at `log`.

    Example:
        >>> part_path(Path("run.mcap"), 2).name
        'run_0002.mcap'
    """
    return log if number == 0 else log.with_name(f"{log.stem}_{number:04d}{log.suffix}")


def first_path(path: Path, number: int) -> Path:
    """Return the path of the first file, by the path of another: see `part_path`."""
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


def open_whole(log: Path) -> Recording:
    """Return what was recorded at `log`, be it one file or several.

    Args:
        log: The only file, or the first, for all there are; the first may have been
            deleted. A later one stands for itself.

    Raises:
        RecordingError: No file can be read, or is a recording of ours; or they are not
            of one run.
    """
    paths = part_paths(log)
    parts: list[Recording] = []
    unread: list[RecordingError] = []
    for path in paths.values():
        try:
            part = Recording.open(path)
        except RecordingError as error:
            unread.append(error)
            continue
        if path == log and (part.part != 0 or len(paths) == 1):
            return part
        parts.append(part)
    if unread and not parts:
        raise unread[0]
    if not parts:
        return Recording.open(log)  # which says why not
    return Whole(parts, tuple(map(str, unread)))


class Whole(Recording):
    """Several files of one run, in order.

    Args:
        parts: Two or more of them, or one that is not the only one of its run.
        unread: Why others cannot be read.

    Raises:
        RecordingError: They are not of one run.
    """

    def __init__(
        self, parts: Sequence[Recording], unread: tuple[str, ...] = ()
    ) -> None:
        # What is written of the run is the same in all, but that the last one knows
        # best how often it was taken up again.
        super().__init__(parts[0].path, parts[-1].layout)
        self.parts = tuple(parts)
        self.unread = unread
        for part in parts:
            options = part.metadata.get("options")
            if part.part is None or options != self.metadata.get("options"):
                rule = f"must be of the run of {self.path}"
                raise RecordingError(f"{part.path}: {rule}, got another")

    @property
    def begins(self) -> int:
        """The tick of the key-frame that the first of them begins with."""
        return self.parts[0].begins

    @property
    def share(self) -> dict[str, int] | None:
        """The numbers that the first of them begins with."""
        return self.parts[0].share

    @property
    def finished(self) -> bool:
        """All of them have their end."""
        return self.cut is None

    @property
    def cut(self) -> Cut | None:
        """Where the first was cut that has no end."""
        return next((part.cut for part in self.parts if part.cut is not None), None)

    @property
    def damage(self) -> tuple[str, ...]:
        """What is known to be missing of them; see `Recording.damage`.

        A file that another one follows and that has no end lacks it.
        """
        lines = [*self.unread]
        lines += chain.from_iterable(part.damage for part in self.parts)
        for before, after in pairwise(self.parts):
            if (cut := before.cut) is not None:
                place = f"byte {cut.offset} of {cut.size}"
                lines.append(f"{before.path}: cut short at {place}")
            if after.part != (before.part or 0) + 1:
                lines.append(f"{after.path}: the file before it is missing")
        return tuple(lines)

    @property
    def gaps(self) -> int:
        """At how many places their writers noted that messages are missing."""
        return sum(part.gaps for part in self.parts)

    @property
    def whole(self) -> bool:
        """All of them are whole, and nothing is missing in between."""
        return all(part.whole for part in self.parts) and super().whole

    def demand_facts(self) -> None:
        """Refuse it, unless one of the files says for sure what the run is."""
        for part in self.parts:
            part.demand_facts()

    @property
    def snapshot(self) -> bytes | None:
        """The final snapshot; None if there was none, or it was not written."""
        return self.parts[-1].snapshot

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int = 0,
        end: int = EVER,
    ) -> Iterator[Recorded]:
        """Return the messages of all of them; see `Recording.messages`."""
        for part in self.parts:
            yield from part.messages(topics, start=start, end=end)

    def noted(self) -> Noted:
        """Return what their writers noted, added up.

        What one ends before and the next begins after is missing.
        """
        noted = [part.noted() for part in self.parts]
        between = Completeness(0, dict(self._between(noted)))
        balances = (each.completeness for each in noted)
        return Noted(added_up([between, *balances]), noted[-1].expected)

    def _between(self, noted: Sequence[Noted]) -> Iterator[tuple[str, int]]:
        lost: dict[str, int] = {}
        both = zip(pairwise(self.parts), noted[:-1], strict=True)
        for (before, after), ended in both:
            if before.totals is None or after.share is None:
                continue
            for who, first in after.share.items():
                gap = first - ended.expected.get(who, 0)
                lost[who] = lost.get(who, 0) + max(0, gap)
        yield from ((who, count) for who, count in lost.items() if count)
