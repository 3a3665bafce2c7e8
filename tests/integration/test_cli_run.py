"""`neurosnap run` in one process: what it says, writes and refuses."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.command_line import RUN_KEYS, call, flat, happy, refused
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


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize(
    "snapshot",
    [
        ("empirical",),
        ("discounted", "--set", "snapshot.decay=0.9", "--threshold", 0.15),
    ],
    ids=["empirical", "discounted"],
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


WRONG_RUNS: dict[str, tuple[tuple[object, ...], str]] = {
    "unknown world": (
        ("neurosnap/Pat-v0",),
        "source: must be a registered environment id or a CSV file (did you mean"
        " neurosnap/Path-v0",
    ),
    "unknown module": (("nowhere.at.all:Path-v0",), "source: must be an environment"),
    "missing file": (
        ("none.csv",),
        "source: must be a file that can be read (No such file or directory),"
        " got 'none.csv'",
    ),
    "threshold": (
        ("CSV", "--threshold", 0.7),
        "threshold: must be a number in (0, 0.25] or 'auto', got 0.7",
    ),
    "threshold 0": (
        ("CSV", "--threshold", 0),
        "threshold: must be a number in (0, 0.25] or 'auto', got",
    ),
    "threshold NaN": (
        ("CSV", "--threshold", "nan"),
        "threshold: must be a number in (0, 0.25] or 'auto'",
    ),
    "threshold text": (
        ("CSV", "--threshold", "low"),
        "threshold: must be a number in (0, 0.25] or 'auto', got 'low'",
    ),
    "threshold auto": (
        ("CSV", "--snapshot", "discounted", "--threshold", "auto"),
        "threshold: must be a number for a discounted snapshot, got 'auto'",
    ),
    "decay 1": (
        ("CSV", "--snapshot", "discounted", "--set", "snapshot.decay=1"),
        "decay: must be in [0, 1), got 1",
    ),
    "decay NaN": (
        ("CSV", "--snapshot", "discounted", "--set", "snapshot.decay=nan"),
        "decay: must be in [0, 1), got nan",
    ),
    "decay alone": (
        ("CSV", "--set", "snapshot.decay=0.5"),
        "decay: must go with a discounted snapshot only, got 0.5",
    ),
    "ticks 0": (("CSV", "--ticks", 0), "ticks: "),
    "ticks below": (("CSV", "--ticks", -5), "got -5"),
    "ticks text": (("CSV", "--ticks", "many"), "Invalid value for '--ticks'"),
    "seed below": (
        ("CSV", "--seed", -1),
        "seed: must be in [0, 9223372036854775807], got",
    ),
    "seed large": (("CSV", "--seed", 2**63), "seed: "),
    "deadline 0": (("CSV", "--set", "cells.deadline=0"), "deadline: "),
    "deadline NaN": (("CSV", "--set", "cells.deadline=nan"), "deadline: "),
    "deadline endless": (("CSV", "--set", "cells.deadline=inf"), "deadline: "),
    "wiring": (
        ("CSV", "--set", "cells.wiring=wired"),
        "wiring: must be 'derived' or 'hasse'",
    ),
    "cells": (("CSV", "--cells", "threads"), "'threads' is not one of 'auto'"),
    "snapshot": (("CSV", "--snapshot", "photo"), "'photo' is not one of 'empirical'"),
    "option": (("CSV", "--speed", 3), "No such option"),
    "no source": ((), "Missing argument"),
}


@pytest.mark.parametrize("what", WRONG_RUNS)
def test_a_wrong_run_is_refused_before_anything_is_written(
    tmp_path: Path, csv: Path, what: str
) -> None:
    given, said = WRONG_RUNS[what]
    arguments = [csv if argument == "CSV" else argument for argument in given]
    out = tmp_path / "out.mcap"
    text = refused("run", "--cells", "inline", "--out", out, *arguments)
    assert said in text
    assert not out.exists()


def test_a_file_with_gaps_runs_and_verifies(tmp_path: Path) -> None:
    source, out = tmp_path / "gaps.csv", tmp_path / "gaps.mcap"
    source.write_text("a;b\n" + "True;on\n;off\n;\nFalse;NA\n" * 3)
    facts = happy("run", source, "--cells", "inline", "--out", out)
    assert facts["ticks"] == 9  # a row without a reading is none
    assert happy("verify", out)["same"]
    assert happy("learn", out)["ticks"] == 9


BAD_FILES = {
    "no text": (b"", "must have a header of sensor names"),
    "no rows": (b"a,b\n", "must have rows below its header, got 0"),
    "a cell too few": (b"a,b\n1,0\n1\n", ":3: must have 2 cells"),
    "no bit": (b"a,b\n1,0\n1,2\n", ":3: b: must be 0 or 1, false or true"),
    "infinity": (b"a,b\n1,inf\n", ":2: b: must be 0 or 1, false or true"),
    "no names": (b"1,0\n0,1\n", ":1: must be a header of sensor names"),
    "one name twice": (b"a,a\n1,0\n", "a"),
    "binary": (b"\xff\xfe\x00", "must be UTF-8 text"),
}


@pytest.mark.parametrize("what", BAD_FILES)
def test_a_bad_file_is_refused_with_the_place(tmp_path: Path, what: str) -> None:
    content, said = BAD_FILES[what]
    source, out = tmp_path / "bad.csv", tmp_path / "out.mcap"
    source.write_bytes(content)
    text = refused("run", source, "--out", out)
    assert f"error: source: {source}" in text
    assert said in text
    assert not out.exists()


def test_an_existing_recording_is_left_alone(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("precious")
    text = refused("run", csv, "--out", out)
    assert f"out: must not exist yet, got '{out}'" in text
    assert out.read_text() == "precious"


def test_a_missing_folder_is_not_made(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "none" / "out.mcap"
    text = refused("run", csv, "--out", out)
    assert f"out: must be in a folder that exists, got '{out}'" in text
    assert not out.parent.exists()
