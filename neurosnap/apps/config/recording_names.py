"""Default file names of recordings."""

import re
from datetime import datetime
from pathlib import Path

from neurosnap.errors import InvalidValueError

_UNFIT = re.compile(r"[^\w.-]+")
_LONGEST = 60  # letters of a source in a name, each up to 4 of the 255 bytes there are

LOGS = Path("logs")
"""Where recordings go unless told otherwise."""


def free_path(path: Path) -> Path:
    """Return where a recording is asked for, if it can go there.

    Raises:
        InvalidValueError: There is something already, or no folder for it.
    """
    if path.is_dir():
        rule = "must name a file that does not exist yet, not a folder"
        raise InvalidValueError("out", rule, str(path))
    if path.exists():
        raise InvalidValueError("out", "must not exist yet", str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    return path


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
