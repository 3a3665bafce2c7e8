"""Deletes the files of a split recording that are no longer kept."""

from collections.abc import Iterable
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import part_paths


def not_kept(log: Path, newest: int, keep: int) -> list[Path]:
    """Return the files there are that are not among the newest.

    Args:
        log: The first file.
        newest: The number of the newest file.
        keep: How many are kept; 0: all.
    """
    if not keep:
        return []
    return [path for n, path in part_paths(log).items() if n <= newest - keep]


def delete(paths: Iterable[Path]) -> None:
    """Delete files; what is gone already is none.

    Raises:
        RecordingError: One of them cannot be deleted.
    """
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            rule = "files that are not kept must be deletable"
            got = f"{error.strerror} for {str(path)!r}"
            raise RecordingError(f"keep: {rule}, got {got}") from error
