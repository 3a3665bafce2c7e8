"""A run in several files on the command line: made, verified, looked at, resumed."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import part_paths
from tests.support.command_line import call, happy
from tools.soak.memory import write_readings

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("split")
    readings, log = folder / "readings.csv", folder / "log.mcap"
    write_readings(readings, 1500, 6, 2)
    arguments = ("--cells", "inline", "--set", "recording.split=64KiB", "--ticks", 1400)
    happy("run", readings, *arguments, "--out", log)
    return log


def test_a_run_comes_in_files_that_are_verified_in_one_go_or_each(log: Path) -> None:
    files = part_paths(log)
    assert len(files) > 1
    whole = happy("verify", log)
    assert (whole["same"], whole["complete"]) == (True, True)
    assert (whole["files"], whole["ticks"]) == (len(files), 1400)
    text = call("verify", files[1]).stdout
    assert "400 ticks after tick 1000 came out the same" in " ".join(text.split())
    named = happy("info", log)["files"]
    assert named == [path.name for path in files.values()]


def test_verifying_may_begin_further_on(log: Path) -> None:
    found = happy("verify", log, "--from", 1234)
    assert (found["start"], found["ticks"], found["same"]) == (1000, 400, True)


def test_a_run_in_files_goes_on_in_the_last(log: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.mcap"
    happy("resume", log, "--ticks", 1450, "--out", new)
    # How much goes into a file depends on when it is flushed: there may be another.
    assert min(part_paths(new)) == len(part_paths(log)) - 1
    found = happy("verify", new)
    assert (found["same"], found["complete"]) == (True, True)
    assert found["start"] + found["ticks"] == 1450
