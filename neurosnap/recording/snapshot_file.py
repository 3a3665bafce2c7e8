"""Saves and loads snapshots as files."""

from pathlib import Path

from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.system.durable import replace_file


def save_snapshot(snapshot: Snapshot, path: str | Path) -> None:
    """Write a snapshot to a file, whole or not at all.

    Raises:
        OSError: It cannot be written; what was at `path` is still there.
    """
    replace_file(Path(path), snapshot.to_bytes())


def load_snapshot(path: str | Path) -> Snapshot:
    """Return the snapshot of either kind that `save_snapshot` wrote, bit for bit.

    Raises:
        OSError: The file cannot be read.
        InvalidValueError: It is damaged, or holds no snapshot.
    """
    return Snapshot.read(str(path), Path(path).read_bytes())
