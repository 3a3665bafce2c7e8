"""The output file of an export: checked, private, and replaced whole or not at all."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from neurosnap.errors import InvalidValueError
from neurosnap.system.durable import replacing

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
    with replacing(path, allowed) as draft:
        yield draft
