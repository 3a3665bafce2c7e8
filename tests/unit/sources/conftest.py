"""A file of readings."""

from pathlib import Path

import pytest

from tests.support.sources import README, written


@pytest.fixture
def readings(tmp_path: Path) -> Path:
    return written(tmp_path, README)
