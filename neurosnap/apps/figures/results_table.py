"""The table of results: each entry is computed once and stored whole or not at all.

Rows are computed by threads: the loops behind them are compiled and give up the
interpreter's lock, so two threads keep two cores busy, share the walks and send nothing
to each other; processes would add their start, their imports and a copy of everything.
A row goes where its number says, whoever computed it, so the number of workers shows
nowhere in a result.
"""

import io
import logging
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments.entry import Entry
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.system.durable import replace_file

_logger = logging.getLogger(__name__)


class Table:
    """A folder with a file for every finished cell.

    Args:
        folder: Where; made when the first cell is stored.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, cell: Entry) -> Path:
        """Return where a cell is stored."""
        digest = sha256(cell.key.encode()).hexdigest()[:16]
        return self._folder / f"{cell.name}-{digest}.npz"

    def load(self, cell: Entry) -> NDArray[Any] | None:
        """Return the rows of a cell: ``(runs, …)``; None if they are not there.

        A file that is damaged, or holds anything else, is as good as none; that is
        logged.
        """
        path = self.path(cell)
        try:
            arrays = _unpacked(path.read_bytes())
            return _rows(cell, arrays)
        except FileNotFoundError:
            return None
        except ValueError as error:
            _logger.warning("%s: is computed anew (%s)", path, error)
            return None

    def store(self, cell: Entry, rows: NDArray[Any]) -> None:
        """Keep the rows of a cell, whole or not at all.

        Raises:
            OSError: They cannot be written.
        """
        buffer = io.BytesIO()
        np.savez_compressed(buffer, key=np.array(cell.key), rows=rows)
        self._folder.mkdir(parents=True, exist_ok=True)
        replace_file(self.path(cell), buffer.getvalue())

    def missing(self, cells: Iterable[Entry]) -> list[Entry]:
        """Return the cells that are not there, in order."""
        return [cell for cell in cells if self.load(cell) is None]

    def fill(
        self,
        cells: Sequence[Entry],
        workers: int,
        on_progress: Callable[[int, int], None],
        cancelled: Callable[[], bool],
    ) -> int:
        """Compute and store cells, in order.

        If it is cancelled, or anything is raised (an interrupt, too), the rows under
        way are finished, no other is begun, and finished cells stay.

        Args:
            cells: Which; none twice.
            workers: How many threads compute.
            on_progress: Told how many rows of how many are done.
            cancelled: Asked after every row whether to stop.

        Returns:
            How many cells were computed.

        Raises:
            OSError: A cell cannot be stored.
        """
        total = sum(cell.runs for cell in cells)
        on_progress(0, total)
        if not cells or cancelled():
            return 0
        with ThreadPoolExecutor(workers, "experiment") as pool:
            tasks = {
                pool.submit(cell.row, run): (cell, run)
                for cell in cells
                for run in range(cell.runs)
            }
            try:
                return self._collect(tasks, total, on_progress, cancelled)
            finally:
                pool.shutdown(cancel_futures=True)

    def _collect(
        self,
        tasks: dict[Future[NDArray[Any]], tuple[Entry, int]],
        total: int,
        on_progress: Callable[[int, int], None],
        cancelled: Callable[[], bool],
    ) -> int:
        """Put rows where they belong; store each cell with its last one."""
        begun: dict[str, tuple[NDArray[Any], set[int]]] = {}
        finished = 0
        for done, task in enumerate(as_completed(tasks), 1):
            cell, run = tasks.pop(task)
            if cell.key not in begun:
                rows = np.empty((cell.runs, *cell.shape), cell.dtype)
                begun[cell.key] = rows, set(range(cell.runs))
            rows, left = begun[cell.key]
            rows[run] = task.result()
            left.remove(run)
            if not left:
                self.store(cell, rows)
                del begun[cell.key]
                finished += 1
            on_progress(done, total)
            if cancelled():
                break
        return finished


def _rows(cell: Entry, arrays: Arrays) -> NDArray[Any]:
    """Return the rows in a cell's file.

    Raises:
        ValueError: They are not, or not those of the cell.
    """
    if str(entry(arrays, "key", (), np.str_).item()) != cell.key:
        raise ValueError("key: must be the cell's")
    return entry(arrays, "rows", (cell.runs, *cell.shape), cell.dtype)


def _unpacked(data: bytes) -> Arrays:
    """Return the arrays of a file.

    Raises:
        ValueError: It is damaged or no such file.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise ValueError("must be an archive of arrays")  # noqa: TRY004
            return dict(archive)
    except (
        AttributeError,
        EOFError,
        KeyError,
        MemoryError,
        NotImplementedError,
        OSError,
        OverflowError,
        RuntimeError,
        SyntaxError,
        TypeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise ValueError(str(error)) from error
