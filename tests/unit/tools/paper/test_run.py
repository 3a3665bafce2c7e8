"""Figures are computed once from their options and written reproducibly."""

import csv
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from tests.support.exhaustive import rows
from tools.paper.figure import FigureOptions
from tools.paper.run import FIGURES, run_figures
from tools.paper.table import Entry, Table


class Squares(Entry, frozen=True, kw_only=True):
    """Squares of numbers, and how often they were asked for."""

    folder: str

    def row(self, run: int) -> Any:
        if (Path(self.folder) / "broken").exists() and run == 1:
            raise ValueError("broken")
        return np.arange(3, dtype=np.uint16) * run


@pytest.mark.slow
@pytest.mark.parametrize("workers", rows([0], [2]))
def test_an_entry_is_computed_once_and_whole_or_not_at_all(
    tmp_path: Path, workers: int
) -> None:
    table, cell = (
        Table(tmp_path / "cells"),
        Squares(runs=3, seed=0, folder=str(tmp_path)),
    )
    (tmp_path / "broken").touch()
    with pytest.raises(ValueError, match="broken"):
        table.fill([cell], workers)
    assert table.load(cell) is None
    (tmp_path / "broken").unlink()
    told: list[tuple[int, int]] = []
    table.fill([cell], workers, lambda *done: told.append(done))
    assert told[0] == (0, 3)
    rows = table.load(cell)
    assert rows is not None
    assert rows.tolist() == [[0, 0, 0], [0, 1, 2], [0, 2, 4]]
    (tmp_path / "broken").touch()
    table.fill([cell], workers)  # there already
    assert cell.key != msgspec.structs.replace(cell, seed=1).key
    table.path(cell).write_bytes(table.path(cell).read_bytes()[:100])
    assert table.load(cell) is None


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_figure_comes_with_its_picture_and_data(tmp_path: Path) -> None:
    options = FigureOptions(
        only=("learning-empirical",), runs=2, steps=40, workers=0, out=tmp_path / "a"
    )
    (made,) = run_figures(options)
    png, svg, pdf, data = (path.read_bytes() for path in made.files)
    assert png.startswith(b"\x89PNG")
    assert svg.startswith(b"<?xml")
    assert pdf.startswith(b"%PDF")
    lines = list(csv.DictReader(data.decode().splitlines()))
    cells = FIGURES["learning-empirical"].cells(options)
    errors = np.stack([cells[0].row(run) for run in range(2)])
    means = [float(row["mean"]) for row in lines[:40]]
    assert means == pytest.approx(errors.mean(axis=0), rel=1e-5)
    assert len(made.claims) == 9
    (again,) = run_figures(msgspec.structs.replace(options, out=tmp_path / "b"))
    for one, other in zip(made.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_what_cannot_be_made_is_refused(tmp_path: Path) -> None:
    for changes, said in (
        ({"only": ("growth", "learnt")}, "only: must be of learning-empirical, "),
        ({"runs": 0}, "runs: must be at least 1, got 0"),
    ):
        options = msgspec.structs.replace(FigureOptions(out=tmp_path), **changes)
        with pytest.raises(InvalidValueError, match=said):
            run_figures(options)
