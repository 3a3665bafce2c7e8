"""Detects a recording that was deleted, moved or replaced during writing.

The system keeps what a program has open, whatever becomes of its name, and drops it
with the last name once it is closed. So a deleted file can be copied until then.
"""

import os
import shutil
from pathlib import Path


def in_place(path: Path, descriptor: int) -> bool:
    """Tell whether a path still names the file that is open."""
    try:
        there = path.stat()
    except OSError:
        return False
    return os.path.samestat(there, os.fstat(descriptor))


def rescued(path: Path, descriptor: int) -> Path | None:
    """Copy an open file that has no name any more.

    Args:
        path: Where it was. The copy goes there, or beside what is there now.
        descriptor: The file's; all that was written to it is flushed.

    Returns:
        Where the copy is; None: the file has a name.

    Raises:
        OSError: It cannot be copied. There is no such copy then.
    """
    if os.fstat(descriptor).st_nlink:
        return None
    number, free = 0, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}.recovered-{number}{path.suffix}")
    with Path(f"/proc/self/fd/{descriptor}").open("rb") as old:
        new = os.open(free, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        try:
            with os.fdopen(new, "wb") as copy:
                shutil.copyfileobj(old, copy, 1 << 20)
                copy.flush()
                os.fsync(copy.fileno())
        except OSError:
            free.unlink(missing_ok=True)
            raise
    return free
