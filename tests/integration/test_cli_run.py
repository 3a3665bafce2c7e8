"""`neurosnap run` in one process: what it says, writes and refuses."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.command_line import RUN_KEYS, call, flat, happy
from tests.support.command_line_files import readings

pytestmark = pytest.mark.slow


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(readings(40), encoding="utf-8")
    return path


def test_an_inline_run_says_what_it_came_to(tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    facts = happy(
        "run", "neurosnap/Path-v0", "--ticks", 25, "--threshold", 0.1, "--cells",
        "inline", "--out", out,
    )  # fmt: skip
    assert facts.keys() >= RUN_KEYS
    assert (facts["log"], facts["ticks"], facts["cells"]) == (str(out), 25, 20)
    assert facts["complete"] is True
    assert facts["stopped"] is False
    assert facts["height"] > 0
    assert ["below_1", "below_2"] in facts["implications"]
    verdict = verify(out)
    assert verdict.same
    assert verdict.complete
    assert verdict.ticks == 25


def test_without_json_people_are_told(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "out.mcap"
    result = call("run", csv, "--cells", "inline", "--threshold", 0.1, "--out", out)
    assert result.exit_code == 0
    told = flat(result.stdout)
    assert "3 (inline, hasse wiring)" in told
    assert "a → b" in told
    assert f"recording: {out}" in told


def test_a_run_that_is_not_recorded_leaves_no_file(tmp_path: Path, csv: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        facts = happy(
            "run", csv, "--cells", "inline", "--set", "recording.record=false"
        )
    assert facts["log"] is None
    assert facts["ticks"] == 40
    assert list(tmp_path.iterdir()) == [csv]


def test_a_recording_gets_a_name_of_its_own(tmp_path: Path, csv: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        logs = [
            happy("run", csv, "--cells", "inline", "--ticks", 3)["log"]
            for _ in range(3)
        ]
        assert all(Recording.open(log).cut is None for log in logs)
    assert len({*logs}) == 3
    assert all(log.startswith("logs/readings-") for log in logs)


@pytest.mark.parametrize(("ticks", "taken"), [((), 40), (("--ticks", 9), 9)])
def test_a_csv_with_times_is_taken_as_far_as_asked(
    tmp_path: Path, ticks: tuple[object, ...], taken: int
) -> None:
    source, out = tmp_path / "timed.csv", tmp_path / "out.mcap"
    source.write_text(readings(40, time=True), encoding="utf-8")
    facts = happy("run", source, "--cells", "inline", "--out", out, *ticks)
    assert facts["ticks"] == taken
    assert facts["cells"] == 3
    assert verify(out).complete


@pytest.mark.parametrize(
    ("wiring", "snapshot"),
    [
        ("hasse", ("empirical",)),
        (
            "derived",
            ("discounted", "--set", "snapshot.decay=0.9", "--threshold", 0.15),
        ),
    ],
)
def test_options_are_kept_in_the_recording(
    tmp_path: Path, csv: Path, wiring: str, snapshot: tuple[object, ...]
) -> None:
    out = tmp_path / "out.mcap"
    facts = happy(
        "run", csv, "--cells", "inline", "--out", out, "--set", f"cells.wiring={wiring}",
        "--seed", 7, "--snapshot", *snapshot,
    )  # fmt: skip
    metadata = Recording.open(out).metadata
    assert (metadata["wiring"], metadata["snapshot"]) == (wiring, snapshot[0])
    assert (metadata["seed"], metadata["source"]) == ("7", str(csv))
    assert facts["complete"] is True


def test_a_file_with_gaps_runs_and_verifies(tmp_path: Path) -> None:
    source, out = tmp_path / "gaps.csv", tmp_path / "gaps.mcap"
    source.write_text("a;b\n" + "True;on\n;off\n;\nFalse;NA\n" * 3)
    facts = happy("run", source, "--cells", "inline", "--out", out)
    assert facts["ticks"] == 9  # a row without a reading is none
    assert happy("verify", out)["same"]
    assert happy("learn", out)["ticks"] == 9
