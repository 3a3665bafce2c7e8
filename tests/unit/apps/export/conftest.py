"""A run to export."""

from pathlib import Path

import pytest

from tests.support.export_runs import recorded


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("run") / "log.mcap")
