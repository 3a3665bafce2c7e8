"""End-to-end tests of the commands that run a swarm and read its recording."""

import itertools
import signal
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from neurosnap import wire
from neurosnap.apps.export import table
from neurosnap.depth import measure
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.write.writer import Writer
from neurosnap.system.picture import KINDS
from tests.support.command_line import call, failed, flat, happy, last_json, refused
from tests.support.command_line_files import changed, cut, readings, record_path
from tests.support.recorded_runs import TICKS
from tests.support.rewritten_recordings import dropping, rewritten

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_path(tmp_path_factory.mktemp("log") / "path.mcap")


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(readings(40), encoding="utf-8")
    return path


# In this process ----------------------------------------------------------------------


def test_a_run_says_what_it_came_to(tmp_path: Path, csv: Path) -> None:
    given = ("run", csv, "--cells", "inline", "--threshold", 0.1, "--seed", 7, "--out")
    one, other = tmp_path / "one.mcap", tmp_path / "other.mcap"
    result = call(*given, one)
    assert result.exit_code == 0
    for said in ("3 (inline, hasse wiring)", "a → b", f"recording: {one}"):
        assert said in flat(result.stdout)
    facts = happy(*given, other)
    assert (facts["log"], facts["ticks"], facts["cells"]) == (str(other), 40, 3)
    assert (facts["complete"], facts["stopped"], facts["height"]) == (True, False, 1)
    assert ["a", "b"] in facts["implications"]
    metadata = Recording.open(one).metadata
    assert (metadata["seed"], metadata["source"]) == ("7", str(csv))


def test_a_run_that_is_not_recorded_leaves_no_file(
    tmp_path: Path, csv: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    nothing = ("--set", "recording.record=false")
    facts = happy("run", csv, "--cells", "inline", *nothing)
    assert (facts["log"], facts["ticks"]) == (None, 40)
    assert list(tmp_path.iterdir()) == [csv]


def test_info_and_verify_say_what_a_recording_holds(log: Path, tmp_path: Path) -> None:
    facts = happy("info", log)
    assert facts["path"] == str(log)
    assert facts["messages"] == sum(1 for _ in Recording.open(log).messages())
    assert "  observation " in call("info", log).stdout
    verdict = happy("verify", log)
    assert (verdict["same"], verdict["complete"], verdict["ticks"]) == (True, True, 30)
    said = "every state and decision of 30 ticks came out the same"
    assert said in call("verify", log).stdout

    result = call("verify", changed(log, tmp_path / "lie"), "--format", "json")
    assert result.exit_code == 1
    assert last_json(result.stdout)["same"] is False
    assert "different: tick 9: /decision coordinator " in result.stderr


def test_verify_says_how_other_options_would_have_gone(
    log: Path, tmp_path: Path
) -> None:
    same = happy("verify", log, "--set", "anomalies.support=10")
    assert (same["same"], same["complete"], same["ticks"]) == (True, True, 30)
    result = call("verify", log, "--set", "anomalies.support=0", "--format", "json")
    facts = last_json(result.stdout)
    (tick, line), count = facts["first"]["anomalies"], facts["differ"]["anomalies"]
    assert (result.exit_code, facts["same"]) == (1, False)
    first = next(iter(Recording.open(log).all("anomaly", wire.Anomaly)))
    assert (tick, count > 1) == (first.tick, True)
    assert result.stderr.splitlines() == [
        f"different: anomalies at {count} of 30 ticks, first at tick {tick}: {line}",
        "same: states, decisions, alarms of 30 ticks",
    ]
    blind = rewritten(log, tmp_path / "a.mcap", dropping(wire.Observation))
    rule = "must hold a whole tick to be derived, got none"
    assert rule in failed("verify", blind, "--set", "anomalies.support=0")


@pytest.mark.parametrize("whole", [True, False])
def test_a_run_goes_on(log: Path, tmp_path: Path, whole: bool) -> None:
    source, out = log if whole else cut(log, tmp_path / "cut"), tmp_path / "more.mcap"
    facts = happy("resume", source, "--ticks", 42, "--out", out)
    assert (facts["resumed"], facts["resumed_at"] == 30) == (str(source), whole)
    assert (facts["log"], facts["ticks"]) == (str(out), 42)
    assert happy("verify", out)["ticks"] == 42


def test_a_run_that_cannot_go_on_says_why(log: Path, tmp_path: Path, csv: Path) -> None:
    first, out, again = (tmp_path / f"{name}.mcap" for name in ("log", "out", "again"))
    few = ("--cells", "inline", "--ticks", 10, "--set", "sensors=a,b")
    happy("run", csv, *few, "--out", first)
    assert f"would read the file '{csv}'" in refused("resume", first, "--out", out)
    every = happy("resume", first, csv, "--out", out)
    assert every["ticks"] == 40  # all that the file has
    text = refused("resume", out, "--trust-source", "--out", again)
    assert "ticks: must be more than the 40 there are" in text
    csv.write_text(csv.read_text().replace("1,1,", "0,1,"))
    assert "ticks 1 to 10 as recorded" in refused("resume", first, csv, "--out", again)
    csv.unlink()
    assert "No such file" in refused("resume", first, csv, "--out", again)
    lie = changed(log, tmp_path / "lie")
    said = f"{lie}: must be a true run: tick 9: /decision"
    assert said in failed("resume", lie, "--out", again)
    assert not again.exists()


@pytest.mark.usefixtures("many_files")
def test_a_run_in_several_files(tmp_path: Path) -> None:
    rows, log, new = (tmp_path / name for name in ("rows.csv", "log.mcap", "new.mcap"))
    rows.write_text(readings(100))
    often = ("--cells", "inline", "--set", "recording.keyframe_every=20")
    happy("run", rows, *often, "--ticks", 50, "--out", log)
    files = part_paths(log)
    whole = happy("verify", log)
    assert (whole["same"], whole["complete"]) == (True, True)
    assert (whole["files"], whole["ticks"]) == (len(files), 50)
    assert len(files) > 1
    said = "20 ticks after tick 20 came out the same"
    assert said in call("verify", files[1]).stdout
    found = happy("verify", log, "--from", 45)
    assert (found["start"], found["ticks"], found["same"]) == (40, 10, True)
    assert happy("info", log)["files"] == [path.name for path in files.values()]

    happy("resume", log, rows, "--ticks", 70, "--out", new)
    # How much goes into a file depends on when it is flushed: there may be another.
    assert min(part_paths(new)) == len(files) - 1
    found = happy("verify", new)
    assert (found["same"], found["start"] + found["ticks"]) == (True, 70)


def test_depth_of_a_recording(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    facts = happy("depth", log, "--out", out)
    assert facts["waves"] == len(facts["rows"]) == 60
    lines = (out / "depth.csv").read_text().splitlines()
    assert lines[0] == "sensors,wiring,height,depth,longest,pulses,seconds"
    assert len(lines) == 1 + 60
    for kind, begins in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        assert Path(facts[kind]).read_bytes().startswith(begins)
    assert len(list(out.iterdir())) == 4
    assert "must not exist yet, or come" in refused("depth", log, "--out", out)


@pytest.mark.zenoh
def test_a_recording_plays(log: Path, tmp_path: Path, endpoint: str) -> None:
    fast = ("--rate", 1e6, "--listen", endpoint)
    facts = happy("play", log, *fast)
    count = sum(1 for _ in Recording.open(log).messages())
    assert (facts["ticks"], facts["messages"]) == (30, count)
    assert happy("play", log, "--from", 20, *fast)["ticks"] == 11
    half = call("play", cut(log, tmp_path / "cut"), *fast, "--format", "json")
    assert half.exit_code == 3
    assert 0 < last_json(half.stdout)["ticks"] < 30
    strange = tmp_path / "strange.mcap"
    with Writer(strange) as writer:
        writer.start({"swarm": "[/red]\x1b"})
        writer.finish({}, {})
    said = f"playing on {endpoint} under neurosnap/'[/red]\\x1b'/**"
    assert said in flat(call("play", strange, *fast).stderr)


@pytest.mark.zenoh
def test_depth_is_measured_in_swarms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = ("depth", "--waves", 2, "--out", tmp_path)
    facts = happy(*given, "--heights", "1,3", "--sensors", 4)
    assert [row["depth"] for row in facts["rows"]] == [1, 1, 3, 3]
    assert facts["line"] is not None
    names = {f"depth.{kind}" for kind in ("csv", *KINDS)}
    assert {path.name for path in tmp_path.iterdir()} == names
    order = ("--edges", 4000, "--seed", 4, "--workers", 3, "--heights", "5,20")
    monkeypatch.setattr(measure, "draw", lambda *_: [])
    random = happy(*given, "--cells", "worker", "--sensors", 600, "--force", *order)
    assert [row["depth"] for row in random["rows"]] == [5, 5, 20, 20]
    assert {row["pulses"] for row in random["rows"]} == {2000}


def test_a_table_goes_beside_the_recording_or_where_it_is_named(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(path_log.parent)
    given = {form: ("-o", f"path.{form}") for form in ("parquet", "rosbag2")}
    for form, out in {"csv": (), **given}.items():
        facts = happy("export", path_log.name, *out)
        assert facts == {
            "path": f"path.{form}",
            "ticks": TICKS,
            "incomplete": 0,
            "whole": True,
        }
        assert Path(facts["path"]).exists()


def ended(number: signal.Signals, log: Path, out: Path) -> Result:
    """Export, and be sent a signal when half of it is written."""
    whole = table.write_csv

    def half(path: Path, columns: Any, rows: Any) -> None:
        whole(path, columns, itertools.islice(rows, TICKS // 2))
        signal.raise_signal(number)

    before = signal.getsignal(number)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("neurosnap.apps.export.table.write_csv", half)
        result = call("export", log, "-o", out)
    assert signal.getsignal(number) is before
    return result


@pytest.mark.parametrize(
    ("name", "ignored"),
    [("SIGINT", False), ("SIGTERM", False), ("SIGHUP", False), ("SIGHUP", True)],
)
def test_whatever_ends_it_leaves_nothing_behind_and_what_is_ignored_does_not(
    path_log: Path, tmp_path: Path, name: str, ignored: bool
) -> None:
    number, out = signal.Signals[name], tmp_path / "out.csv"
    # Whoever started the tests may have had them ignore it.
    ends = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    before = signal.signal(number, signal.SIG_IGN if ignored else ends)
    try:
        result = ended(number, path_log, out)
    finally:
        signal.signal(number, before)
    assert result.exit_code == (0 if ignored else 128 + number)
    assert list(tmp_path.iterdir()) == ([out] if ignored else [])
    assert ignored or result.stdout == ""
