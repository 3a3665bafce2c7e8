"""The disk of a simulated swarm: which files survive a crash.

A disk may be full at any write, and flip bits in what was written. A power cut may take
all that was not synced, or leave zeros for it; a file may be taken away by somebody, or
be cut short while it is written. What was damaged is remembered, since nobody may
delete it.
"""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import part_paths
from neurosnap.recording.read.recording_file import RecordingFile
from tools.simulate.simulated_faults import Case

_TORN = [0, 10, 20, 2000]  # bytes; fewer than what a run says of itself


class Disk:
    """Damages the files of one run.

    Args:
        case: The run.
    """

    def __init__(self, case: Case) -> None:
        self._case = case
        self._log = case.log
        self._chance = case.chance
        self._tally = case.tally
        self.damaged: list[bytes] = []
        """What is in each file that has a flipped bit in a chunk: in a tick."""

    def lose(self) -> None:
        """Leave of each file without end any beginning, and maybe zeros behind it."""
        chance, paths = self._chance, list(part_paths(self._log).values())
        power = chance.random() < self._case.weather.power
        self._tally.powercuts += power
        for path in paths:
            try:
                if RecordingFile.open(path).cut is None:
                    continue
            except RecordingError:
                continue  # its start was cut off
            # What a run begins with may be lost. A later file begins on the disk, but
            # for a power cut, and where its death came first.
            torn = [0, 20] if paths == [self._log] or power else []
            before = path.stat().st_size
            size = chance.choice([*torn, *_ends(path)])
            if 0 < paths.index(path) == len(paths) - 1:
                if chance.random() < self._case.weather.begun:
                    size = chance.choice(_TORN)
                self._tally.begun += size in _TORN
            with path.open("r+b") as file:
                file.truncate(size)
                if power and chance.random() < 0.5:
                    file.truncate(before)

    def truncate(self) -> None:
        """Cut the last file short, maybe, while it is written."""
        chance = self._chance
        if chance.random() < self._case.weather.truncate:
            self._tally.truncated += 1
            path = [*part_paths(self._log).values()][-1]
            size = chance.randrange(path.stat().st_size + 1)
            os.truncate(path, chance.choice([0, size]))

    def decay(self) -> None:
        """Flip a bit, or take a file away."""
        chance, paths = self._chance, list(part_paths(self._log).values())
        if paths and chance.random() < self._case.weather.vanish:
            self._tally.vanished += 1
            self._forget(path := paths.pop())
            path.unlink()
        if paths and chance.random() < self._case.weather.flip:
            self._flip(chance.choice(paths))

    def _flip(self, path: Path) -> None:
        content, chance = bytearray(path.read_bytes()), self._chance
        if not content:
            return
        at = chance.randrange(len(content))
        is_tick = self._forget(path) or _in_chunk(path, at)
        content[at] ^= 1 << chance.randrange(8)
        path.write_bytes(content)
        self._tally.flips += 1
        if is_tick:
            self.damaged.append(bytes(content))

    def _forget(self, path: Path) -> bool:
        """Expect no more of a damaged file; tell whether it was one."""
        content = path.read_bytes()
        was_damaged = content in self.damaged
        self.damaged = [other for other in self.damaged if other != content]
        return was_damaged

    def lost(self) -> list[bytes]:
        """Return what was damaged and is in no file any more."""
        there = {path.read_bytes() for path in self._log.parent.glob("run*")}
        return [content for content in self.damaged if content not in there]

    def check_space(self) -> None:
        """Raise an error as a full disk does, in some cases.

        Raises:
            OSError: It is.
        """
        if self._chance.random() < self._case.weather.full:
            self._tally.full += 1
            raise OSError(errno.ENOSPC, "No space left on device")


def _in_chunk(path: Path, at: int) -> bool:
    """Tell whether a byte is among the messages of a whole recording."""
    try:
        chunks = RecordingFile.open(path).layout.chunks
    except RecordingError:
        return False
    return any(chunk.offset <= at < chunk.offset + chunk.packed for chunk in chunks)


def _ends(log: Path) -> Iterator[int]:
    """Yield where a file can end with some of its chunks, the next one torn or not."""
    layout = RecordingFile.open(log).layout
    yield layout.size
    for chunk in layout.chunks:
        yield chunk.offset
        yield chunk.offset + chunk.packed
