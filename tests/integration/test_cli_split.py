"""A run in several files on the command line: made, verified, looked at, resumed."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.recording.read.recording import part_paths
from tools.soak.memory import write_readings

pytestmark = pytest.mark.slow


def neurosnap(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == code, result.output
    return result.output


def facts(*arguments: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(
        neurosnap(*arguments, "--format", "json").splitlines()[-1]
    )
    return found


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("split")
    readings, log = folder / "readings.csv", folder / "log.mcap"
    write_readings(readings, 1500, 6, 2)
    arguments = ("--cells", "inline", "--set", "recording.split=64KiB", "--ticks", 1400)
    neurosnap("run", readings, *arguments, "--out", log)
    return log


def test_a_run_comes_in_files_that_are_verified_in_one_go_or_each(log: Path) -> None:
    files = part_paths(log)
    assert len(files) > 1
    whole = facts("verify", log)
    assert (whole["same"], whole["complete"]) == (True, True)
    assert (whole["files"], whole["ticks"]) == (len(files), 1400)
    text = neurosnap("verify", files[1])
    assert "400 ticks after tick 1000 came out the same" in " ".join(text.split())
    named = facts("info", log)["files"]
    assert named == [path.name for path in files.values()]


def test_verifying_may_begin_further_on(log: Path) -> None:
    found = facts("verify", log, "--from", 1234)
    assert (found["start"], found["ticks"], found["same"]) == (1000, 400, True)


def test_a_run_in_files_goes_on_in_the_last(log: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.mcap"
    neurosnap("resume", log, "--ticks", 1450, "--out", new)
    # How much goes into a file depends on when it is flushed: there may be another.
    assert min(part_paths(new)) == len(part_paths(log)) - 1
    found = facts("verify", new)
    assert (found["same"], found["complete"]) == (True, True)
    assert found["start"] + found["ticks"] == 1450


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--set", "recording.split=10MB"), "must be like 256MiB, got '10MB'"),
        (("--set", "recording.split=-1"), "must be like 256MiB, got '-1'"),
        (
            ("--set", "recording.split=63KiB"),
            "must be 0, or at least 65536 bytes, got 64512",
        ),
        (("--set", "recording.keep=2"), "keep: must come with split, got 2"),
    ],
)
def test_a_wrong_size_is_refused(
    arguments: tuple[str, ...], said: str, log: Path, tmp_path: Path
) -> None:
    readings = log.with_name("readings.csv")
    new = tmp_path / "new.mcap"
    text = neurosnap("run", readings, *arguments, "--out", new, code=2)
    assert said in " ".join(text.replace("│", " ").split())
    assert not new.exists()
