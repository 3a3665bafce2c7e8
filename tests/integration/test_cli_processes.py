"""Verbs that run swarms of processes come to what they should."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.system.picture import KINDS
from tests.support.command_line import RUN_KEYS, last_json
from tests.support.command_line_files import readings
from tests.support.disturbed_commands import finish, sound, started

pytestmark = pytest.mark.slow


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(readings(40), encoding="utf-8")
    return path


@pytest.mark.zenoh
def test_a_run_of_processes_that_goes_on(tmp_path: Path, csv: Path) -> None:
    one, other = tmp_path / "one.mcap", tmp_path / "other.mcap"
    runs = (
        (("run", csv, "--ticks", 25, "--out", one), one, 25),
        (("resume", one, "--out", other), other, 40),
    )
    for arguments, log, ticks in runs:
        with started(*arguments, "--format", "json", folder=tmp_path) as process:
            code, stdout, stderr = finish(process)
        assert code == 0, stderr
        assert "Traceback" not in stderr
        facts = last_json(stdout)
        assert facts.keys() >= RUN_KEYS
        assert facts["log"] == str(log)
        assert (facts["ticks"], facts["cells"], facts["complete"]) == (ticks, 3, True)
        verdict = sound(log)
        assert verdict.complete
        assert verdict.ticks == ticks
        assert facts.get("resumed_at") == (25 if log == other else None)


@pytest.mark.zenoh
def test_two_runs_at_once_do_not_meet(tmp_path: Path, csv: Path) -> None:
    arguments = ("run", csv, "--format", "json")
    with (
        started(*arguments, "--seed", 1, folder=tmp_path) as one,
        started(*arguments, "--seed", 2, folder=tmp_path) as other,
    ):
        ends = [finish(process) for process in (one, other)]
    assert [code for code, _, _ in ends] == [0, 0], ends
    logs = [tmp_path / last_json(stdout)["log"] for _, stdout, _ in ends]
    assert logs[0] != logs[1]
    recordings = [Recording.open(log) for log in logs]
    assert recordings[0].swarm != recordings[1].swarm
    for log, seed in zip(logs, ("1", "2"), strict=True):
        assert Recording.open(log).metadata["seed"] == seed
        verdict = sound(log)
        assert verdict.complete
        assert verdict.ticks == 40


@pytest.mark.zenoh
def test_depth_is_measured_in_swarms(tmp_path: Path) -> None:
    arguments = (
        "--heights",
        "1,3",
        "--sensors",
        "4",
        "--waves",
        "2",
        "--format",
        "json",
    )
    with started("depth", *arguments, folder=tmp_path) as process:
        code, stdout, stderr = finish(process)
    assert code == 0, stderr
    facts = last_json(stdout)
    assert [row["height"] for row in facts["rows"]] == [1, 1, 3, 3]
    assert [row["depth"] for row in facts["rows"]] == [1, 1, 3, 3]
    assert facts["line"] is not None
    names = {f"depth.{kind}" for kind in ("csv", *KINDS)}
    assert {path.name for path in tmp_path.iterdir()} == names
