"""Files that survive crashes and power cuts, and files that belong to this user alone.

They are synced, and replaced whole or not at all: where a file cannot be written, what
was there is there still, and an `OSError` says why.

A program's writes go to the system's memory first; `fsync` waits until the disk has
them. A new or renamed file needs its folder synced, too, or its name may be gone. After
an `fsync` that failed the system may have dropped what it could not write, so a second
one proves nothing: give up the file.
"""

import errno
import io
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from neurosnap.errors import naming

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_BLOCK = 1 << 20
_NO_FOLDERS = frozenset({errno.EINVAL, errno.ENOTSUP})
"""Said of folders by file systems that write names down at once."""


def is_own(path: Path, denied: int) -> bool:
    """Return whether a file or folder is this user's, and no link.

    Args:
        path: What must be there.
        denied: Permissions that it must not give, such as 0o022: others may not write.

    Raises:
        OSError: It cannot be looked at.
    """
    found = path.lstat()
    own = found.st_uid == os.getuid() and not stat.S_ISLNK(found.st_mode)
    return own and not found.st_mode & denied


def opened_file(path: str | Path) -> BinaryIO:
    """Open a plain file to be read: a pipe or a device could be read for ever.

    Raises:
        OSError: It is none, or cannot be read.
    """
    found = Path(path).stat().st_mode
    if not (stat.S_ISREG(found) or stat.S_ISDIR(found)):
        raise OSError(errno.EINVAL, "Not a file but a pipe or a device")
    return Path(path).open("rb")


def sync_file(path: Path) -> None:
    """Wait until the disk has a file, and its name in the folder."""
    _sync(path)
    sync_folder(path.parent)


@contextmanager
def replacing(path: Path, mode: int = 0o666) -> Iterator[Path]:
    """Give a draft beside `path` to write, which replaces it if nothing goes wrong.

    Args:
        path: What is replaced, or made.
        mode: Its permissions, less the user's mask.

    Raises:
        OSError: It cannot be written; what was at `path` is still there.
    """
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    draft.unlink(missing_ok=True)  # left by a dead process that had our number
    try:
        with naming(path):
            os.close(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode))
            yield draft
            _sync(draft)
            os.replace(draft, path)  # noqa: PTH105 - the one that replaces atomically
    finally:
        draft.unlink(missing_ok=True)


def replace_file(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with replacing(path) as draft:
        draft.write_bytes(data)


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the names in a folder."""
    try:
        _sync(folder)
    except OSError as error:
        if error.errno not in _NO_FOLDERS:
            raise


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class OwnFile(io.FileIO):
    """A new file that detects writes by other programs, and data its disk lost.

    It looks before each write: what was cut short has its old length again after it.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "wb")
        self._length = self._checksum = 0  # of what was written
        self._proved = 0, 0  # of what was read back
        self._time = os.fstat(descriptor).st_mtime_ns  # 0: of no use
        self._changed = False

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write; return how many bytes the system took."""
        self.is_as_written()
        count = super().write(data) or 0
        self._checksum = zlib.crc32(memoryview(data)[:count], self._checksum)
        self._length += count
        self._time = self._time and os.fstat(self.fileno()).st_mtime_ns
        return count

    def is_as_written(self) -> bool:
        """Tell whether nothing is known to have changed it; it is read if in doubt."""
        found = os.fstat(self.fileno())
        self._changed |= found.st_size != self._length
        if self._time not in (0, found.st_mtime_ns):
            self._time = 0  # not all file systems set it as they are written to
            self.read_back(whole=True)
        return not self._changed

    def read_back(self, *, whole: bool = False) -> None:
        """Prove what was written since the last time, or all, by its checksum."""
        start, before = (0, 0) if whole else self._proved
        found = None
        with suppress(OSError), Path(f"/proc/self/fd/{self.fileno()}").open("rb") as me:
            found = checksum_of(me, start, self._length, before)
        self._changed |= found != self._checksum
        self._proved = self._length, self._checksum


def checksum_of(file: BinaryIO, start: int, stop: int, before: int = 0) -> int:
    """Return the CRC-32 of a range of a file behind what has `before`; stand there."""
    file.seek(start)
    while start < stop and (block := file.read(min(_BLOCK, stop - start))):
        before = zlib.crc32(block, before)
        start += len(block)
    return before
