"""`neurosnap replay` verifies a recording and goes on with it."""

from pathlib import Path

import pytest

from tests.support.command_line import (
    RUN_KEYS,
    call,
    failed,
    flat,
    happy,
    last_json,
    refused,
)
from tests.support.command_line_files import (
    changed,
    cut,
    readings,
    record_path,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_path(tmp_path_factory.mktemp("log") / "path.mcap")


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(readings(40), encoding="utf-8")
    return path


def test_a_true_recording_verifies(log: Path) -> None:
    facts = happy("verify", log)
    assert (facts["same"], facts["complete"], facts["ticks"]) == (True, True, 30)
    told = call("verify", log).stdout
    assert "every state and decision of 30 ticks came out the same" in flat(told)


def test_a_tampered_recording_fails(log: Path, tmp_path: Path) -> None:
    result = call("verify", changed(log, tmp_path / "lie"), "--format", "json")
    assert result.exit_code == 1
    facts = last_json(result.stdout)
    assert facts["same"] is False
    assert facts["difference"].startswith("tick 9: /decision coordinator ")
    assert "different: tick 9: /decision" in flat(result.stderr)


def test_a_truncated_recording_is_lacking(log: Path, tmp_path: Path) -> None:
    result = call("verify", cut(log, tmp_path / "cut"), "--format", "json")
    assert result.exit_code == 3
    facts = last_json(result.stdout)
    assert (facts["same"], facts["complete"]) == (True, False)
    assert 0 < facts["ticks"] < 30
    assert "the recording is incomplete" in result.stderr


def test_a_run_goes_on(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "more.mcap"
    facts = happy("resume", log, "--ticks", 42, "--out", out)
    assert facts.keys() >= RUN_KEYS | {"resumed", "resumed_at"}
    assert (facts["resumed"], facts["resumed_at"]) == (str(log), 30)
    assert (facts["log"], facts["ticks"]) == (str(out), 42)
    assert happy("verify", out)["ticks"] == 42


def test_a_cut_run_goes_on(log: Path, tmp_path: Path) -> None:
    half, out = cut(log, tmp_path / "cut"), tmp_path / "more.mcap"
    facts = happy("resume", half, "--ticks", 35, "--out", out)
    assert 0 < facts["resumed_at"] < 30
    assert happy("verify", out)["ticks"] == 35


def test_a_run_of_a_file_goes_on_to_the_end_of_the_file(
    tmp_path: Path, csv: Path
) -> None:
    log, out, again = (tmp_path / name for name in ("log", "out", "again"))
    happy("run", csv, "--cells", "inline", "--ticks", 10, "--out", log)
    assert happy("resume", log, "--out", out)["ticks"] == 40
    text = refused("resume", out, "--out", again)
    assert "ticks: must be more than the 40 there are" in text
    csv.unlink()
    assert "No such file" in refused("resume", log, "--out", again)
    assert not again.exists()


def test_a_tampered_run_does_not_go_on(log: Path, tmp_path: Path) -> None:
    lie, out = changed(log, tmp_path / "lie"), tmp_path / "out.mcap"
    text = failed("resume", lie, "--out", out)
    assert f"{lie}: must be a true run: tick 9: /decision" in text
    assert not out.exists()
