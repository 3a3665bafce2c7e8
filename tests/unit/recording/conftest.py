"""A run in one file, and files that are split at every key-frame."""

from pathlib import Path

import pytest

from neurosnap.recording.write import rotation
from neurosnap.recording.write.rotation import Split
from tests.support.split_runs import made


@pytest.fixture(scope="session", params=[0, 2], ids=["cells", "workers"])
def whole(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A run in one file."""
    return made(tmp_path_factory.mktemp("whole") / "log.mcap", request.param)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every key-frame begin another file."""
    monkeypatch.setattr(rotation, "split_of", lambda _: Split(1))
