"""Files that survive a crash and a power cut: synced, and replaced whole or not at all.

A program's writes go to the system's memory first; `fsync` waits until the disk has
them. A new or renamed file needs its folder synced, too, or its name may be gone. After
an `fsync` that failed the system may have dropped what it could not write, so a second
one proves nothing: give up the file.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from neurosnap.errors import naming

_NO_FOLDERS = frozenset({errno.EINVAL, errno.ENOTSUP})
"""Said of folders by file systems that write names down at once."""


def sync_file(path: Path) -> None:
    """Wait until the disk has a file, and its name in the folder.

    Raises:
        OSError: It cannot be written.
    """
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
    """Write `data` to `path`, whole or not at all.

    Raises:
        OSError: It cannot be written; what was at `path` is still there.
    """
    with replacing(path) as draft:
        draft.write_bytes(data)


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the names in a folder.

    Raises:
        OSError: They cannot be written.
    """
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
