"""Names new recordings, and refuses to replace existing files."""

import os
import re
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from neurosnap.errors import InvalidValueError
from neurosnap.system.durable import replacing, sync_file, sync_folder

_UNFIT = re.compile(r"[^\w.-]+")
_LONGEST = 60  # letters of a source in a name, each up to 4 of the 255 bytes there are
_EVERYBODY, _READ = 0o666, 0o444
LOGS = Path("logs")
"""Where recordings go by default."""


def free_path(
    path: Path, *, force: bool | None = None, reads: Collection[Path] = ()
) -> Path:
    """Return a path if it may be written to.

    Args:
        path: Where to.
        force: Whether a file there is replaced; None for what is never replaced.
        reads: What is read to write it; not even `force` replaces that.

    Raises:
        InvalidValueError: Something is there already, or there is no folder for it.
    """
    if path.exists():
        # Nor a folder, a pipe or a device, which would make place for a file.
        if not path.is_file() or any(path.samefile(source) for source in reads):
            rule = "must be another file, not a folder or what is read"
            raise InvalidValueError("out", rule, str(path))
        if not force:
            more = "" if force is None else ", or come with --force"
            raise InvalidValueError("out", f"must not exist yet{more}", str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    return path


def free_log(path: Path) -> Path:
    """Return a path if a recording may be written to it; refuse it as `free_path`."""
    if free_path(path).suffix != ".mcap":
        raise InvalidValueError("out", "must end with .mcap", str(path))
    return path


@contextmanager
def placed(path: Path, *, force: bool, reads: Collection[Path]) -> Iterator[Path]:
    """Give a temporary file to write, which becomes `path` if nothing goes wrong.

    Only those may read it who may read all that is exported.

    Args:
        path: Where to.
        force: Replace what is there.
        reads: What is exported; not even `force` replaces that.

    Raises:
        InvalidValueError: As in `free_path`.
        OSError: It cannot be written.
    """
    free_path(path, force=force, reads=reads)
    with replacing(path, _allowed(reads)) as draft:
        yield draft


@contextmanager
def placed_folder(path: Path, *, reads: Collection[Path]) -> Iterator[Path]:
    """Give a temporary folder for files, which becomes `path` if nothing goes wrong.

    Only those may read it who may read all that is exported.

    Args:
        path: Where to; it must not exist.
        reads: What is exported.

    Raises:
        InvalidValueError: Something is there already, or there is no folder for it.
        OSError: It cannot be written.
    """
    if path.exists():
        raise InvalidValueError("out", "must not exist yet", str(path))
    draft = free_path(path).with_name(f".{path.name}.{os.getpid()}.part")
    shutil.rmtree(draft, ignore_errors=True)  # left by a dead process of our number
    try:
        draft.mkdir(0o700)
        yield draft
        mode = _allowed(reads)
        for file in draft.iterdir():
            mode &= file.stat().st_mode  # less the user's mask
            file.chmod(mode)
            sync_file(file)
        draft.chmod(0o700 | mode | (mode & _READ) >> 2)
        draft.rename(path)
        sync_folder(path.absolute().parent)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _allowed(reads: Collection[Path]) -> int:
    """Return the permissions that all of some files give."""
    allowed = _EVERYBODY
    for source in reads:
        allowed &= source.stat().st_mode
    return allowed


def new_path(source: str, folder: Path = LOGS) -> Path:
    """Return a new name for a recording, after its source and the time.

    Args:
        source: As in `neurosnap.sources.open.open_source`.
        folder: Where to; it need not exist, if the one that it is in does.

    Raises:
        InvalidValueError: There cannot be such a folder.
    """
    if not folder.is_dir() and (
        folder.exists() or not folder.absolute().parent.is_dir()
    ):
        rule = "must be a folder, or be in one that exists"
        raise InvalidValueError("folder", rule, str(folder))
    # With letters, digits and few signs that every file system takes; scp and rsync
    # would take what is before a colon for a host.
    stem = _UNFIT.sub("-", Path(source).stem.removesuffix("-v0").lower())
    name = stem[:_LONGEST].strip("-.") or ("stdin" if source == "-" else "run")
    now = datetime.now().astimezone()
    return folder / f"{name}-{now:%Y%m%d-%H%M%S-%f}.mcap"
