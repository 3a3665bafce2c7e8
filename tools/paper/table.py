"""The table of results, whose entries are each computed once and stored atomically.

Rows are computed by processes. They come in order, whichever process computed them, so
the number of workers shows nowhere in a result.
"""

import io
import json
import logging
import zipfile
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from hashlib import sha256
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.system.durable import replace_file

_logger = logging.getLogger(__name__)


class Entry(msgspec.Struct, frozen=True, kw_only=True):
    """An entry of the table: as many rows as there are runs, all of one shape."""

    VERSION: ClassVar[int] = 1
    """Raised whenever the same fields come to give other rows."""

    runs: int
    """How many rows it has, each from nothing."""
    seed: int
    """Draws what there is to draw."""

    @property
    def key(self) -> str:
        """All that its rows depend on: kind, version and fields as a line of JSON."""
        made = {"kind": type(self).__name__, "version": self.VERSION}
        return json.dumps(made | msgspec.to_builtins(self), sort_keys=True)

    @abstractmethod
    def row(self, run: int) -> NDArray[Any]:
        """Return a row: a function of the entry and `run`."""


class Table:
    """A folder with a file for every finished entry.

    Args:
        folder: Where; made when the first entry is stored.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, entry: Entry) -> Path:
        """Return where an entry is stored."""
        digest = sha256(entry.key.encode()).hexdigest()[:16]
        return self._folder / f"{type(entry).__name__}-{digest}.npz"

    def load(self, entry: Entry) -> NDArray[Any] | None:
        """Return the rows of an entry: ``(runs, …)``; None if they are not there.

        A file that is damaged is as good as none; that is logged.
        """
        path = self.path(entry)
        try:
            data = io.BytesIO(path.read_bytes())
            with np.load(data, allow_pickle=False) as archive:
                rows: NDArray[Any] = archive["rows"]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
            _logger.warning("%s: is computed anew (%s)", path, error)
            return None
        return rows

    def store(self, entry: Entry, rows: Sequence[NDArray[Any]]) -> None:
        """Keep the rows of an entry, whole or not at all."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, rows=np.stack(rows))
        self._folder.mkdir(parents=True, exist_ok=True)
        replace_file(self.path(entry), buffer.getvalue())

    def fill(
        self,
        entries: Iterable[Entry],
        workers: int,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> None:
        """Compute and store the entries that are not there, in order.

        If anything is raised, such as an interrupt, no other row is begun, and
        finished entries stay.

        Args:
            entries: Which; none twice.
            workers: How many processes compute; 0: this one.
            on_progress: Told how many rows of how many are done.
        """
        missing = [entry for entry in entries if self.load(entry) is None]
        tasks = [(entry, run) for entry in missing for run in range(entry.runs)]
        done = 0
        on_progress(done, len(tasks))
        with _computed(tasks, workers) as rows:
            for entry in missing:
                self.store(entry, list(islice(rows, entry.runs)))
                done += entry.runs
                on_progress(done, len(tasks))


@contextmanager
def _computed(
    tasks: Sequence[tuple[Entry, int]], workers: int
) -> Iterator[Iterator[NDArray[Any]]]:
    """Yield the rows of tasks, in order, as they are computed."""
    if not workers:
        yield map(_row, tasks)
        return
    with ProcessPoolExecutor(workers, get_context("forkserver")) as pool:
        try:
            yield pool.map(_row, tasks)
        finally:
            pool.shutdown(cancel_futures=True)


def _row(task: tuple[Entry, int]) -> NDArray[Any]:
    entry, run = task
    return entry.row(run)
