"""The table of results: each entry is computed once and stored whole or not at all.

Rows are computed by processes. A row goes where its number says, whichever process
computed it, so the number of workers shows nowhere in a result.
"""

import io
import json
import logging
import zipfile
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import DTypeLike, NDArray

from neurosnap.system.durable import replace_file

_logger = logging.getLogger(__name__)


class Entry(msgspec.Struct, frozen=True, kw_only=True):
    """An entry of the table: as many rows as there are runs, all of one shape."""

    VERSION: ClassVar[int] = 1
    """Raised whenever the same fields come to give other rows."""
    dtype: ClassVar[DTypeLike] = np.uint16
    """The type of a row."""

    runs: int
    """How many rows it has, each from nothing."""
    seed: int
    """Draws what there is to draw."""

    @property
    @abstractmethod
    def name(self) -> str:
        """The readable part of its file's name."""

    @property
    def key(self) -> str:
        """All that its rows depend on, as one line of JSON."""
        return key_of(self)

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """The shape of a row."""

    @abstractmethod
    def row(self, run: int) -> NDArray[Any]:
        """Return a row: a function of the entry and `run`."""


def key_of(entry: Entry) -> str:
    """Return the kind, version and fields of an entry as JSON."""
    made = {"kind": type(entry).__name__, "version": entry.VERSION}
    return json.dumps(made | msgspec.to_builtins(entry), sort_keys=True)


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
        return self._folder / f"{entry.name}-{digest}.npz"

    def load(self, entry: Entry) -> NDArray[Any] | None:
        """Return the rows of an entry: ``(runs, …)``; None if they are not there.

        A file that is damaged is as good as none; that is logged.
        """
        path, shape = self.path(entry), (entry.runs, *entry.shape)
        try:
            data = io.BytesIO(path.read_bytes())
            with np.load(data, allow_pickle=False) as archive:
                rows: NDArray[Any] = archive["rows"]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
            _logger.warning("%s: is computed anew (%s)", path, error)
            return None
        return rows if rows.shape == shape and rows.dtype == entry.dtype else None

    def store(self, entry: Entry, rows: NDArray[Any]) -> None:
        """Keep the rows of an entry, whole or not at all."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, rows=rows)
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
        total = sum(entry.runs for entry in missing)
        on_progress(0, total)
        if not workers:
            for entry in missing:
                self.store(entry, _stacked([entry.row(k) for k in range(entry.runs)]))
            return
        with ProcessPoolExecutor(workers, get_context("forkserver")) as pool:
            tasks = {
                pool.submit(entry.row, run): (entry, run)
                for entry in missing
                for run in range(entry.runs)
            }
            try:
                self._collect(tasks, total, on_progress)
            finally:
                pool.shutdown(cancel_futures=True)

    def _collect(
        self,
        tasks: dict[Future[NDArray[Any]], tuple[Entry, int]],
        total: int,
        on_progress: Callable[[int, int], None],
    ) -> None:
        """Put rows where they belong; store each entry with its last one."""
        begun: dict[str, dict[int, NDArray[Any]]] = {}
        for done, task in enumerate(as_completed(tasks), 1):
            entry, run = tasks.pop(task)
            rows = begun.setdefault(entry.key, {})
            rows[run] = task.result()
            if len(rows) == entry.runs:
                self.store(entry, _stacked([rows[k] for k in range(entry.runs)]))
                del begun[entry.key]
            on_progress(done, total)


def _stacked(rows: Sequence[NDArray[Any]]) -> NDArray[Any]:
    return np.stack(rows)
