"""A run that a file describes, on the command line."""

import json
from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.command_line import call

FILE = """
[source]
kind = "csv"
path = "readings.csv"
[run]
ticks = 20
[snapshot]
kind = "discounted"
threshold = 0.1
[cells]
kind = "inline"
[recording]
folder = "recordings"
keyframe_every = 5
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    rows = ["0,0,0", "0,1,0", "1,1,0", "0,0,1"] * 10
    readings = "\n".join(["door,motion,light", *rows])
    (tmp_path / "readings.csv").write_text(readings, encoding="utf-8")
    path = tmp_path / "swarm.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("flags", "ticks", "snapshot"),
    [
        ((), 20, "discounted"),
        (("--ticks", 7), 7, "discounted"),
        (("--ticks", 300), 40, "discounted"),
        (("--snapshot", "empirical"), 20, "empirical"),
    ],
)
def test_a_file_is_run_and_flags_go_before_it(
    file: Path, flags: tuple[object, ...], ticks: int, snapshot: str
) -> None:
    result = call("run", file, *flags, "--format", "json")
    assert result.exit_code == 0, result.stderr
    facts = json.loads(result.stdout)
    log = Path(facts["log"])
    assert (facts["ticks"], log.parent) == (ticks, file.parent / "recordings")
    metadata = Recording.open(log).metadata
    assert (metadata["snapshot"], metadata["keyframe_every"]) == (snapshot, "5")
    assert verify(log).complete


def test_a_wrong_file_is_refused_before_anything_is_written(file: Path) -> None:
    file.write_text(FILE.replace("0.1", "0.7"), encoding="utf-8")
    result = call("run", file)
    assert result.exit_code == 2
    rule = "snapshot.threshold: must be a number in (0, 0.25] or 'auto', got 0.7"
    assert result.stderr == f"error: {file}:9: {rule}\n"
    assert not (file.parent / "recordings").exists()
    assert call("run", file, "--threshold", 0.1).exit_code == 0
