"""Cells of the table are computed once, kept whole, and never believed on sight."""

import logging
from pathlib import Path
from threading import Event, Lock
from typing import Any

import numpy as np
import pytest
from numpy.typing import DTypeLike, NDArray

from neurosnap.apps.figures.experiments.entry import Entry
from neurosnap.apps.figures.results_table import Table


class Squares:
    """A cell whose rows are easy to know; it counts how often it is asked."""

    def __init__(self, key: str, runs: int = 4, dtype: DTypeLike = np.int64) -> None:
        self.name = "squares"
        self.key = key
        self.runs = runs
        self.shape: tuple[int, ...] = (2, 3)
        self.dtype = dtype
        self.asked: list[int] = []
        self._lock = Lock()

    def row(self, run: int) -> NDArray[Any]:
        with self._lock:
            self.asked.append(run)
        return np.full(self.shape, run**2 + len(self.key), self.dtype)

    def whole(self) -> NDArray[Any]:
        rows = [np.full(self.shape, r**2 + len(self.key)) for r in range(self.runs)]
        return np.stack(rows)


class Gated(Squares):
    """One that has no row before its gate is open: a test says when that is.

    Its rows take a millisecond each, so that all of them take longer than to stop.
    """

    def __init__(self, key: str, runs: int) -> None:
        super().__init__(key, runs)
        self.gate = Event()
        self._never = Event()

    def row(self, run: int) -> NDArray[Any]:
        self.gate.wait()
        self._never.wait(0.001)
        return super().row(run)


def fill(table: Table, *cells: Entry, workers: int = 2, stop_at: int = 10**9) -> int:
    told: list[tuple[int, int]] = []
    filled = table.fill(
        table.missing(cells),
        workers,
        lambda done, total: told.append((done, total)),
        lambda: told[-1][0] >= stop_at,
    )
    assert [done for done, _ in told] == list(range(len(told)))
    return filled


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_rows_are_where_they_belong_whoever_computed_them(
    tmp_path: Path, workers: int
) -> None:
    table, cells = Table(tmp_path / "new"), [Squares("a"), Squares("bb", runs=7)]
    assert fill(table, *cells, workers=workers) == 2
    for cell in cells:
        loaded = table.load(cell)
        assert loaded is not None
        assert (loaded == cell.whole()).all()
        assert sorted(cell.asked) == list(range(cell.runs))


def test_what_is_there_is_not_computed_again(tmp_path: Path) -> None:
    table, again, fresh = Table(tmp_path), Squares("a"), Squares("b")
    fill(table, Squares("a"))
    assert fill(table, again, fresh) == 1
    assert not again.asked
    assert len(fresh.asked) == 4


def test_cancelled_it_keeps_what_is_finished(tmp_path: Path) -> None:
    table, last = Table(tmp_path), Gated("c", 2000)
    cells = [Squares("a"), Squares("b"), last]

    def seven(done: int, _: int) -> None:
        if done == 7:  # of the eight rows before the gate: a or b lacks one
            last.gate.set()

    assert table.fill(cells, 2, seven, last.gate.is_set) == 1
    assert sum(table.load(cell) is not None for cell in cells) == 1
    assert len(last.asked) < 2000
    assert fill(table, *cells) == 2


def test_cancelled_from_the_start_it_computes_nothing(tmp_path: Path) -> None:
    cell = Squares("a")
    assert fill(Table(tmp_path), cell, stop_at=0) == 0
    assert not cell.asked


def test_interrupted_it_keeps_what_is_finished_and_goes_on_up(tmp_path: Path) -> None:
    table, first, second = Table(tmp_path), Squares("a"), Gated("b", 5000)

    def interrupt(done: int, _: int) -> None:
        if done == first.runs:
            second.gate.set()  # what is under way may end
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        table.fill([first, second], 2, interrupt, lambda: False)
    assert table.load(first) is not None
    assert table.load(second) is None
    assert len(second.asked) < 5000


def test_a_row_that_fails_fails_the_call(tmp_path: Path) -> None:
    class Broken(Squares):
        def row(self, run: int) -> NDArray[Any]:
            raise ZeroDivisionError(run)

    with pytest.raises(ZeroDivisionError):
        fill(Table(tmp_path), Broken("a"))
    assert not list(tmp_path.iterdir())


def test_a_damaged_file_is_computed_anew(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    table, cell = Table(tmp_path), Squares("a")
    fill(table, cell)
    path = table.path(cell)
    whole = path.read_bytes()
    foreign = [b"", b"no archive", b"\x93NUMPY\x01\x00"]
    cut = [whole[:k] for k in range(1, len(whole), 29)]
    for data in foreign + cut:
        path.write_bytes(data)
        with caplog.at_level(logging.ERROR):
            assert table.load(cell) is None
    for place in range(0, len(whole), 7):
        path.write_bytes(
            whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :]
        )
        loaded = table.load(cell)
        # A flipped bit may fall where nothing is kept: a date, a host.
        assert loaded is None or (loaded == cell.whole()).all()
    path.write_bytes(whole[:-30])
    assert fill(table, cell) == 1
    assert path.read_bytes() == whole
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_file_of_something_else_is_not_believed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    table, cell = Table(tmp_path), Squares("a")
    fill(table, Squares("b"))
    table.path(Squares("b")).replace(table.path(cell))
    assert table.load(cell) is None
    assert "is computed anew (key: must be the cell's)" in caplog.text
    for wrong in (Squares("a", runs=3), Squares("a", dtype=np.float64)):
        table.store(wrong, np.stack([wrong.row(run) for run in range(wrong.runs)]))
        assert table.load(cell) is None
    table.path(cell).unlink()
    objects = np.array([{}], dtype=object)
    np.savez(table.path(cell), key=np.array("a"), rows=objects, allow_pickle=True)
    assert table.load(cell) is None
