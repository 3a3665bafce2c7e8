"""Syncs files to disk on a thread of its own.

Waiting for the disk may take long, and the recorder must not. One file that has its end
is saved at a time: a run that writes faster than the disk takes it waits there, so that
no heap of files grows that a power cut would take. A file that grows is not waited
for at its last sync; the next one begins after it.

A sync that failed is raised once, and what was written is given up: the system may have
dropped it, so that a second sync would succeed and say nothing.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from neurosnap.errors import RecordingError
from neurosnap.recording.write.writer import Writer
from neurosnap.system.durable import sync_folder


class FsyncThread:
    """Saves files one after the other. To be used from one thread.

    What did not reach the disk, or was to follow that and failed, raises a
    `RecordingError` once, from the next method that is called.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "record/saving")
        self._under_way: Future[None] | None = None
        self._syncing: Future[None] | None = None
        self._named: set[Path] = set()  # whose names the disk has; the thread's own

    def sync(self, files: Sequence[Writer]) -> bool:
        """Sync the data written to open files so far, without waiting.

        Does nothing while the last sync is under way.

        Returns:
            It begins: what the last one was to write is on the disk.
        """
        self.check()
        if self._syncing is not None:
            return False
        # A writer's own may be closed meanwhile, and its number be another file's.
        opened = [(os.dup(file.file.fileno()), file.path) for file in files]
        self._syncing = self._thread.submit(self._sync, opened)
        return True

    def _sync(self, opened: Sequence[tuple[int, Path]]) -> None:
        try:
            for descriptor, path in opened:
                try:
                    os.fsync(descriptor)
                    if path not in self._named:
                        sync_folder(path.parent)
                        self._named.add(path)
                except FileNotFoundError:
                    pass  # the folder was moved; the next flush notices
                except OSError as error:
                    rule = "must reach the disk"
                    got = f"{error.strerror} for {str(path)!r}"
                    raise RecordingError(f"log: {rule}, got {got}") from error
        finally:
            for descriptor, _ in opened:
                os.close(descriptor)

    def save(self, file: Writer, then: Callable[[], None]) -> None:
        """Sync and finish a file, once the one before is synced.

        Args:
            file: It has its end.
            then: What to do once it is saved, on the thread; not done if it cannot be.
        """

        def saved() -> None:
            file.save()
            then()

        self.wait()
        self._under_way = self._thread.submit(saved)

    def check(self) -> bool:
        """Tell whether all is saved; raise what `wait` and `close` would, by now."""
        if self._under_way is not None and self._under_way.done():
            self.wait()
        if self._syncing is not None and self._syncing.done():
            self._wait_for_sync()
        return self._under_way is None

    def _wait_for_sync(self) -> None:
        synced, self._syncing = self._syncing, None
        if synced is not None:
            synced.result()

    def wait(self) -> None:
        """Wait until the last file is saved."""
        saved, self._under_way = self._under_way, None
        if saved is not None:
            saved.result()

    def close(self) -> None:
        """End the thread, once it has saved all files; may be called twice."""
        self._thread.shutdown()
        self.wait()
        self._wait_for_sync()
