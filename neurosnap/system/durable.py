"""What survives a power cut: files and folders that are given to the disk.

What a program writes is in the system's memory first. `fsync` waits until the disk has
it; of a new or renamed file that goes for its folder, too, or its name may be gone.
After an `fsync` that failed the system may have dropped what it could not write, so
another one says nothing: whoever is told of a failure gives up what was written.
"""

import errno
import os
from pathlib import Path

_NO_FOLDERS = frozenset({errno.EINVAL, errno.ENOTSUP})
"""Said of folders by file systems that write names down at once."""


def sync_file(path: Path) -> None:
    """Wait until the disk has a file, and its name in the folder.

    Raises:
        OSError: It cannot be written.
    """
    _sync(path)
    sync_folder(path.parent)


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
