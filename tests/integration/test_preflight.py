"""A command reports missing requirements before it starts anything."""

import json
import sys
from pathlib import Path

import pytest

from neurosnap.runtime import preflight
from tests.support.command_line import call

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)


def test_a_run_to_be_viewed_is_refused_before_it_starts(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    run = call("run", "neurosnap/Path-v0", "--view", "--out", "a.mcap")
    view = call("view", "a.mcap")
    assert run.exit_code == view.exit_code == 1
    assert run.stderr == view.stderr
    assert run.stderr.startswith("error: view: must have uvicorn installed (run `pip")
    assert list(folder.iterdir()) == []


def test_a_run_that_does_not_fit_is_refused_before_it_starts(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preflight, "free_memory", lambda: 700_000_000)
    path = ("run", "neurosnap/Path-v0", "--ticks", 1)
    many = call(*path, "--set", "places=100000")
    assert many.exit_code == 2
    assert "sensors: must be at most 2,886 here" in many.stderr
    cells = call(*path, "--set", "places=40")
    assert cells.exit_code == 2
    assert "cells: must be at most 16 here: each takes 6 MB" in cells.stderr
    assert list(folder.iterdir()) == []
    inline = call(*path, "--set", "places=40", "--cells", "inline")
    assert inline.exit_code == 0, inline.stderr


@pytest.mark.usefixtures("without_matplotlib")
def test_depth_without_matplotlib_writes_its_table(path_log: Path) -> None:
    result = call("depth", path_log, "--out", "d", "--format", "json")
    assert result.exit_code == 0, result.stderr
    assert "no picture: depth.png: must have matplotlib installed" in result.stderr
    facts = json.loads(result.stdout.splitlines()[-1])
    assert (facts["csv"], facts["png"]) == ("d/depth.csv", None)
    assert [path.name for path in Path("d").iterdir()] == ["depth.csv"]
