"""Recordings that several of the tests here look at; nobody writes to them."""

from pathlib import Path

import pytest

from tests import preloaded
from tests.unit.view.films import csv_run, path_run, planner_run, recorded


@pytest.fixture(scope="session")
def path_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "path.mcap")


@pytest.fixture(scope="session")
def planner_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(planner_run(), tmp_path_factory.mktemp("planner") / "planner.mcap")


@pytest.fixture(scope="session")
def csv_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("csv")
    return recorded(csv_run(folder / "readings.csv"), folder / "csv.mcap")


@pytest.fixture(scope="session", autouse=True)
def fork_server() -> None:
    preloaded.start()
