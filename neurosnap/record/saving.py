"""Files that have their end are given to the disk, on a thread of its own.

Waiting for the disk may take long, and whoever records must not. One file at a time is
saved: who writes faster than the disk takes it waits there, so that no heap of files
grows that a power cut would take.
"""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.record.writer import Writer


class Saving:
    """Saves files one after the other. To be used from one thread."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "record/saving")
        self._under_way: Future[None] | None = None

    def save(self, file: Writer, unwanted: Sequence[Path]) -> None:
        """Let a file be saved; wait first until the one before is.

        Args:
            file: It has its end.
            unwanted: What to delete, once it is saved.

        Raises:
            RecordingError: As `wait`.
        """
        self.wait()
        self._under_way = self._thread.submit(_save, file, unwanted)

    def check(self) -> None:
        """Raise what `wait` would, if there is nothing to wait for."""
        if self._under_way is not None and self._under_way.done():
            self.wait()

    def wait(self) -> None:
        """Wait until the last file is saved.

        Raises:
            RecordingError: It cannot be, or others cannot be deleted. It is said once.
        """
        saved, self._under_way = self._under_way, None
        if saved is not None:
            saved.result()

    def close(self) -> None:
        """End the thread, once it has saved what there is; may be called twice.

        Raises:
            RecordingError: As `wait`.
        """
        self._thread.shutdown()
        self.wait()


def _save(file: Writer, unwanted: Sequence[Path]) -> None:
    file.save()
    for path in unwanted:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            rule = "files that are not kept must be deletable"
            got = f"{error.strerror} for {str(path)!r}"
            raise RecordingError(f"keep: {rule}, got {got}") from error
