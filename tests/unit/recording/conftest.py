"""A run in one file, and files that are split at every key-frame."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from tests.support.split_runs import SMALL, SplitRun, made


@pytest.fixture(scope="session", params=[0, 2], ids=["cells", "workers"])
def whole(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A run in one file."""
    return made(tmp_path_factory.mktemp("whole") / "log.mcap", request.param)


@pytest.fixture(scope="session")
def recorded(whole: Path) -> SplitRun:
    """All that was recorded of it."""
    return SplitRun(whole, tuple(Recording.open(whole).messages()), whole)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Where to record."""
    return tmp_path / "log.mcap"


@pytest.fixture
def run(recorded: SplitRun, log: Path) -> SplitRun:
    """The same, to be recorded again in several files."""
    return recorded._replace(log=log)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every key-frame of a run begin another file."""
    monkeypatch.setattr(
        "neurosnap.runtime.parts.recorder_process.split_of", lambda _: SMALL
    )
