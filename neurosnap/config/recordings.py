"""Where a run is recorded."""

from datetime import datetime
from pathlib import Path

from neurosnap.errors import InvalidValueError

LOGS = Path("logs")
"""Where recordings go unless told otherwise."""


def free_path(path: Path) -> Path:
    """Return where a recording is asked for, if it can go there.

    Raises:
        InvalidValueError: There is something already, or no folder for it.
    """
    if path.exists():
        raise InvalidValueError("out", "must not exist yet", str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    return path


def new_path(source: str, folder: Path = LOGS) -> Path:
    """Return a new name for a recording, after its source and the time.

    Args:
        source: As in `neurosnap.source.open_source`.
        folder: Where to; it need not exist, if the one that it is in does.

    Raises:
        InvalidValueError: There cannot be such a folder.
    """
    if not folder.is_dir() and (
        folder.exists() or not folder.absolute().parent.is_dir()
    ):
        rule = "must be a folder, or be in one that exists"
        raise InvalidValueError("folder", rule, str(folder))
    name = Path(source).stem.removesuffix("-v0").lower() or "run"
    now = datetime.now().astimezone()
    return folder / f"{name}-{now:%Y%m%d-%H%M%S-%f}.mcap"
