"""``neurosnap watch`` of a recording in which nothing contradicts what was learned."""

from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from tests.support.command_line import call
from tests.support.recorded_runs import csv_run, recorded


def watched(folder: Path, rows: Sequence[str], **changes: object) -> Path:
    """Record a run that watches rows of the sensors a, b and c."""
    readings = folder / "readings.csv"
    options = replace(csv_run(readings, len(rows)), **({"watch": True} | changes))
    readings.write_text("\n".join(["a,b,c", *rows]) + "\n")
    return recorded(options, folder / "log.mcap")


def said_of(log: Path, *flags: str) -> str:
    done = call("watch", log, *flags)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_run_that_did_not_look_for_any_says_so(tmp_path: Path) -> None:
    log = watched(tmp_path, 7 * ["1,0,1"], watch=False)
    assert said_of(log) == "anomalies were not looked for in these 7 ticks\n"


def test_a_run_without_any_says_in_how_many_ticks(tmp_path: Path) -> None:
    log = watched(tmp_path, 7 * ["1,0,1"])
    assert said_of(log) == "no anomalies in 7 ticks\n"
    assert said_of(log, "--format", "json") == ""


def test_what_rests_on_few_occasions_is_left_out_unless_asked_for(
    tmp_path: Path,
) -> None:
    rows = ["0,0,1", "0,1,1", *["1,1,1", "0,0,1"] * 12, "1,0,1", "0,0,1"]
    log = watched(tmp_path, rows, threshold=0.25)
    assert said_of(log).startswith(
        "tick 27: b is off while a is on: never before in 12 occasions;"
        " b or a may be wrong\n"
    )
    assert said_of(log, "--support", "13") == (
        f"no anomalies in {len(rows)} ticks, but for 3 that rest on fewer than 13"
        " occasions (--support 0 shows them)\n"
    )


def test_support_cannot_be_asked_of_a_run_that_counted_no_occasions(
    tmp_path: Path,
) -> None:
    log = watched(tmp_path, 3 * ["1,0,1"], support=0)
    done = call("watch", log, "--support", "2")
    assert done.exit_code == 2
    assert "support: must be 0 for a run that did not count occasions" in done.output
    assert said_of(log, "--support", "0") == "no anomalies in 3 ticks\n"
