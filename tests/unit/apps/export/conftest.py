"""A run, and what is drawn of it."""

from pathlib import Path

import pytest

from neurosnap.apps.export import foxglove_recording
from neurosnap.apps.export.foxglove_recording import write_drawable
from neurosnap.recording.read.recording import Recording
from tests.support.export_runs import TICKS, recorded


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("run") / "log.mcap")


@pytest.fixture(scope="session")
def drawn(log: Path) -> Path:
    path = log.with_name("drawn.mcap")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(foxglove_recording, "_EVERY", 0)
        assert write_drawable(path, Recording.open(log)) == TICKS
    return path
