"""Figures from options to files: whole, the same each time, and of the cells' data."""

import csv
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from neurosnap.apps.figures import learners, run
from neurosnap.apps.figures.experiments.learning_error import TruthKind
from neurosnap.apps.figures.figure import FigureOptions
from neurosnap.apps.figures.run import FIGURES, run_figures
from neurosnap.errors import InvalidValueError
from neurosnap.system.picture import KINDS
from tests.support.commands import Command
from tests.support.patience import PATIENCE

LEARNING = ("learning-empirical", "learning-discounted", "learning-compared")
pytestmark = pytest.mark.slow


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """For what is said of the data: to draw a picture takes a second."""
    monkeypatch.setattr(run, "_pictures", lambda _: {"png": b"\x89PNG"})


def options(out: Path, **changes: Any) -> FigureOptions:
    small = FigureOptions(out=out, only=LEARNING, runs=3, steps=200)
    return msgspec.structs.replace(small, **changes)


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_each_figure_comes_with_its_data_and_its_facts(tmp_path: Path) -> None:
    results = run_figures(options(tmp_path, seed=11))
    assert [figure.name for figure in results.figures] == list(LEARNING)
    assert (results.computed, results.reused, results.missing) == (80, 0, 0)
    for figure in results.figures:
        png, svg, pdf, data, facts = (path.read_bytes() for path in figure.files)
        assert png.startswith(b"\x89PNG")
        assert svg.startswith(b"<?xml")
        assert pdf.startswith(b"%PDF")
        assert data.startswith(b"setting,threshold,decay,step,mean,std,min,max\r\n")
        told = msgspec.json.decode(facts)
        assert told["options"] == {
            "seed": 11,
            "runs": 3,
            "steps": 200,
            "truth": "contained",
            "equivalences": False,
        }
        assert told["agreement"] == figure.agreement
        assert len(told["claims"]) == len(figure.claims) > 0
        assert len(told["curves"]) == len(figure.lines)
        assert set(told["versions"]) == {"python", "neurosnap", "numpy", "numba"}


@pytest.mark.usefixtures("undrawn")
def test_the_data_are_those_of_the_cells(tmp_path: Path) -> None:
    given = options(tmp_path, only=("3",))
    run_figures(given)
    with (tmp_path / "learning-compared.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    cells = FIGURES["learning-compared"].cells(given)
    assert len(rows) == len(cells) * given.steps
    for number, cell in enumerate(cells):
        errors = np.stack([cell.row(run) for run in range(given.runs)])
        chosen = rows[number * given.steps : (number + 1) * given.steps]
        assert [int(row["step"]) for row in chosen] == list(range(1, given.steps + 1))
        means = [float(row["mean"]) for row in chosen]
        assert means == pytest.approx(errors.mean(axis=0), rel=1e-5)
        spreads = [float(row["std"]) for row in chosen]
        assert spreads == pytest.approx(errors.std(axis=0), rel=1e-5)
        assert [int(row["min"]) for row in chosen] == errors.min(axis=0).tolist()
        assert [int(row["max"]) for row in chosen] == errors.max(axis=0).tolist()
    assert {row["threshold"] for row in rows} == {repr(1 / 8000)}
    assert {row["decay"] for row in rows} == {"", repr(1 - 2**-6)}


@pytest.mark.usefixtures("undrawn")
def test_figures_share_cells_and_a_second_call_computes_none(tmp_path: Path) -> None:
    first = run_figures(options(tmp_path, only=("learning-compared",)))
    assert (first.computed, first.reused) == (8, 0)
    both = run_figures(options(tmp_path, only=("2", "3")))
    assert (both.computed, both.reused) == (36, 8)
    before = contents(tmp_path)
    again = run_figures(options(tmp_path, only=("2", "3")))
    assert (again.computed, again.reused, again.missing) == (0, 44, 0)
    assert contents(tmp_path) == before


@pytest.mark.usefixtures("undrawn")
def test_workers_change_nothing(tmp_path: Path) -> None:
    for workers in (1, 3):
        given = options(tmp_path / str(workers), only=("3",), workers=workers)
        run_figures(given)
    one, three = contents(tmp_path / "1"), contents(tmp_path / "3")
    assert len(one) == 8 + 3
    assert one == three


@pytest.mark.usefixtures("undrawn")
def test_other_options_are_other_cells(tmp_path: Path) -> None:
    changes: list[dict[str, Any]] = [
        {},
        {"seed": 1},
        {"runs": 2},
        {"steps": 100},
        {"truth": "thresholded"},
        {"equivalences": True},
    ]
    for change in changes:
        results = run_figures(options(tmp_path, only=("3",), **change))
        assert (results.computed, results.reused) == (8, 0)


@pytest.mark.usefixtures("undrawn")
def test_cancelled_it_makes_what_is_complete(tmp_path: Path) -> None:
    told: list[int] = []
    # The first 40 cells are all of the first figure, and both figures come from there.
    results = run_figures(
        options(tmp_path, workers=1),
        lambda done, total: told.append(done),
        lambda: told[-1] >= 130,
    )
    assert 40 <= results.computed < 80
    assert results.computed + results.missing == 80
    assert [figure.name for figure in results.figures] == ["learning-empirical"]
    assert not list(tmp_path.glob("learning-discounted.*"))
    rest = run_figures(options(tmp_path))
    assert (rest.computed, rest.reused) == (results.missing, results.computed)
    assert len(rest.figures) == 3


@pytest.mark.usefixtures("undrawn")
def test_a_damaged_cell_is_computed_anew(tmp_path: Path) -> None:
    run_figures(options(tmp_path, only=("3",)))
    before = contents(tmp_path)
    victim = next((tmp_path / "cells").glob("*.npz"))
    victim.write_bytes(victim.read_bytes()[:100])
    assert run_figures(options(tmp_path, only=("3",))).computed == 1
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("runs", "steps", "truth"),
    [(1, 1, "contained"), (1, 2, "thresholded"), (2, 9, "contained")],
)
def test_the_smallest_figures_are_figures(
    tmp_path: Path, runs: int, steps: int, truth: TruthKind
) -> None:
    results = run_figures(options(tmp_path, runs=runs, steps=steps, truth=truth))
    assert len(results.figures) == 3


def test_against_the_thresholded_truth_every_path_learner_errs_less_and_less(
    tmp_path: Path,
) -> None:
    given = options(tmp_path, truth="thresholded", steps=4000, only=("1",))
    run_figures(given)
    for cell in learners.empirical(given):
        if cell.setting == "path":
            rows = np.stack([cell.row(run) for run in range(given.runs)])
            assert rows[:, -1].mean() < rows[:, 99].mean() / 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": 0}, "runs: must be at least 1, got 0"),
        ({"steps": 0}, "steps: must be at least 1, got 0"),
        ({"workers": 0}, "workers: must be at least 1, got 0"),
        ({"seed": -1}, "seed: must be at least 0, got -1"),
        ({"truth": "no"}, 'truth: must be "contained" or "thresholded", got \'no\''),
    ],
)
def test_an_option_out_of_range_is_named(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidValueError) as caught:
        run_figures(options(tmp_path / "new", **change))
    assert str(caught.value) == message
    assert not (tmp_path / "new").exists()


def test_an_unknown_figure_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"^only: must be of .* got 'nine'$"):
        run_figures(options(tmp_path, only=("1", "nine")))


def test_the_verb_makes_them_too(tmp_path: Path) -> None:
    small = ["--runs", "2", "--steps", "150", "--out", tmp_path]
    with Command("figures", "--only", "1,learning-compared", *small) as verb:
        said, errors = verb.communicate(PATIENCE)
        assert verb.wait(PATIENCE) == 0, errors
    assert said.startswith("cells: 44 computed, 0 reused\n")
    assert said.count("holds: ") > 0
    for name in ("learning-empirical", "learning-compared"):
        for kind in KINDS:
            assert (tmp_path / f"{name}.{kind}").is_file()


def test_the_verb_names_what_is_wrong() -> None:
    with Command("figures", "--runs", "0") as verb:
        _, errors = verb.communicate(PATIENCE)
        assert verb.wait(PATIENCE) == 2
    assert errors == "error: runs: must be at least 1, got 0\n"
