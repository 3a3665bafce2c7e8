"""The files of a recording that may still grow, split or not."""

import os
from collections.abc import Sequence
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.recording.format.index_scan import IndexScan, scan_growth, scan_index
from neurosnap.recording.format.records import Chunk, opened
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.read.split_files import part_paths


class File:
    """One file, as far as it was looked at.

    Args:
        path: A recording.

    Raises:
        RecordingError: It cannot be read, or says nothing of its run.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.identity = identity(path)  # before it is read: another may come after
        self.seen: IndexScan = scan_index(path)
        self.recording = Recording.seen(path, self.seen.layout)

    @property
    def chunks(self) -> Sequence[Chunk]:
        """What lies where in it."""
        return self.seen.layout.chunks

    @property
    def cuts(self) -> tuple[str, ...]:
        """What in it cannot be read, and where it ends before its end."""
        damage, cut = self.recording.damage, self.recording.cut
        if cut is None:
            return damage
        place = f"at byte {cut.offset} of {cut.size}"
        said = f"{self.path}: cut short after {cut.chunks} whole chunks, {place}"
        return (*damage, said)


class Files:
    """All files there are of the run that is recorded at `log`, in order.

    Chunks are counted from 0, through all of them.

    Args:
        log: The only file, or the first. A later one stands for itself.

    Raises:
        RecordingError: A file cannot be read, or says nothing of its run.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        paths = list(part_paths(log).values()) or [log]  # which says that it is not
        self._files = [File(paths[0])]
        self.split = self._files[0].recording.part is not None
        if self.split:
            self._files += map(File, paths[1:])
        self._count()

    def _count(self) -> None:
        self._places = [(file, chunk) for file in self._files for chunk in file.chunks]

    def __len__(self) -> int:
        """Return the number of chunks."""
        return len(self._places)

    def place(self, number: int) -> tuple[File, Chunk]:
        """Return a chunk and the file it is in."""
        return self._places[number]

    def grow(self) -> tuple[bool, bool]:
        """Look at what the files have gained.

        Returns:
            Whether that is anything, and whether chunks have other numbers since: a
            file is finished for a while yet after the next was begun.

        Raises:
            RecordingError: A file cannot be read.
        """
        dropped = self._drop_deleted()
        before = [len(file.chunks) for file in self._files]
        # All of them, and not only up to the first that has grown.
        gains = [scan_growth(file.path, file.seen) for file in self._files]
        grown = dropped or any(gains)
        if self.split:
            fresh = self._fresh()
            self._files += fresh
            grown = grown or bool(fresh)
        after = [len(file.chunks) for file in self._files]
        if grown:
            self._count()
        moved = before[:-1] != after[: len(before) - 1] or (
            len(after) > len(before) and before[-1] != after[len(before) - 1]
        )
        return grown, dropped or moved

    def _drop_deleted(self) -> bool:
        """Leave out files that were deleted from the beginning; return whether any."""
        there = [file for file in self._files if file.path.exists()]
        if not self.split or not there or len(there) == len(self._files):
            return False
        self._files = there
        return True

    def _fresh(self) -> list[File]:
        """Return the files that are new, as far as they have begun."""
        known = {file.path for file in self._files}
        fresh = []
        for path in part_paths(self._log).values():
            if path not in known:
                try:
                    fresh.append(File(path))
                except RecordingError:
                    break  # nothing is written in it yet: it is looked at again
        return fresh

    def replaced(self) -> bool:
        """Return whether the first there is now is none of those that were there.

        Raises:
            RecordingError: None is there.
        """
        paths = list(part_paths(self._log).values()) if self.split else []
        first = paths[0] if paths else self._files[0].path
        known = {file.path: file.identity for file in self._files}
        return identity(first) != known.get(first)

    @property
    def first(self) -> Recording:
        """The first of them."""
        return self._files[0].recording

    @property
    def last(self) -> Recording:
        """The last, which knows best what became of the run."""
        return self._files[-1].recording

    @property
    def finished(self) -> bool:
        """All of them have their end."""
        return all(file.recording.finished for file in self._files)

    @property
    def troubled(self) -> bool:
        """One of them is damaged, whatever is added to it."""
        return any(file.recording.damage for file in self._files)

    @property
    def cuts(self) -> list[str]:
        """What in them cannot be read, and where they end before their end."""
        return [line for file in self._files for line in file.cuts]


def identity(path: Path) -> tuple[int, int]:
    """Return what tells a file from another of the same name.

    Raises:
        RecordingError: It cannot be read.
    """
    with opened(path) as file:
        found = os.fstat(file.fileno())
    return found.st_dev, found.st_ino
