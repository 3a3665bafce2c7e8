"""Verbs that look into a recording, or at the machine."""

import json
from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from tests.support.command_line import call, happy, last_json
from tests.support.command_line_files import cut, record_path

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_path(tmp_path_factory.mktemp("log") / "path.mcap")


def test_info_says_what_is_in_a_recording(log: Path, tmp_path: Path) -> None:
    facts = happy("info", log)
    assert facts["path"] == str(log)
    assert facts["messages"] == sum(1 for _ in Recording.open(log).messages())
    assert " observation " in call("info", log).stdout
    lacking = call("info", cut(log, tmp_path / "cut"), "--format", "json")
    assert lacking.exit_code == 3
    assert json.loads(lacking.stdout)["messages"] < facts["messages"]


def test_depth_of_a_recording(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    facts = happy("depth", log, "--out", out)
    assert facts["waves"] == len(facts["rows"]) == 60
    lines = (out / "depth.csv").read_text().splitlines()
    assert lines[0] == "sensors,wiring,height,depth,longest,pulses,seconds"
    assert len(lines) == 1 + 60
    for kind, begins in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        path = out / f"depth.{kind}"
        assert path.read_bytes().startswith(begins)
        assert facts[kind] == str(path)
    assert len(list(out.iterdir())) == 4


def test_doctor_exits_by_what_it_finds() -> None:
    result = call("check", "--format", "json")
    findings = last_json(result.stdout)["findings"]
    assert findings
    assert result.exit_code == (0 if all(f["ok"] for f in findings) else 1)
