"""Where an export goes: there whole or not at all, and over nothing by accident."""

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from neurosnap.errors import InvalidValueError


@contextmanager
def placed(path: Path, *, force: bool, reads: Collection[Path]) -> Iterator[Path]:
    """Give a place to write, which becomes `path` if nothing goes wrong.

    Args:
        path: Where to.
        force: Replace what is there.
        reads: What is exported; not even `force` replaces that.

    Raises:
        InvalidValueError: There is something already, or no folder for it.
        OSError: It cannot be written.
    """
    if path.exists():
        if path.is_dir() or any(path.samefile(source) for source in reads):
            raise InvalidValueError("out", "must be another file", str(path))
        if not force:
            rule = "must not exist yet, or come with --force"
            raise InvalidValueError("out", rule, str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield draft
        os.replace(draft, path)  # noqa: PTH105 - the one that replaces atomically
    finally:
        draft.unlink(missing_ok=True)
