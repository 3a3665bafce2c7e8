"""Where an export goes: there whole or not at all, and over nothing by accident."""

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from neurosnap.errors import InvalidValueError, naming

_EVERYBODY = 0o666


@contextmanager
def placed(path: Path, *, force: bool, reads: Collection[Path]) -> Iterator[Path]:
    """Give a place to write, which becomes `path` if nothing goes wrong.

    Only those may read it who may read all that is exported.

    Args:
        path: Where to.
        force: Replace what is there.
        reads: What is exported; not even `force` replaces that.

    Raises:
        InvalidValueError: There is something already, or no folder for it.
        OSError: It cannot be written.
    """
    if path.exists():
        # Nor a folder, a pipe or a device, which would make place for a file.
        if not path.is_file() or any(path.samefile(source) for source in reads):
            raise InvalidValueError("out", "must be another file", str(path))
        if not force:
            rule = "must not exist yet, or come with --force"
            raise InvalidValueError("out", rule, str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    allowed = _EVERYBODY
    for source in reads:
        allowed &= source.stat().st_mode
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    draft.unlink(missing_ok=True)  # of somebody dead, who had our number
    try:
        with naming(path):
            os.close(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, allowed))
            yield draft
            os.replace(draft, path)  # noqa: PTH105 - the one that replaces atomically
    finally:
        draft.unlink(missing_ok=True)
