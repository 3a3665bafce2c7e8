"""``neurosnap watch`` of a recording in which nothing contradicts what was learned."""

from pathlib import Path

import msgspec

from tests.support.command_line import call
from tests.support.recorded_runs import csv_run, recorded

GOLDEN = Path(__file__).parents[3] / "golden" / "run-2-resumed.mcap"


def said_of(log: Path, *flags: str) -> str:
    done = call("watch", log, *flags)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_run_that_did_not_look_for_any_says_so() -> None:
    assert said_of(GOLDEN) == "anomalies were not looked for in these 12 ticks\n"


def test_a_run_without_any_says_in_how_many_ticks(tmp_path: Path) -> None:
    readings = tmp_path / "readings.csv"
    options = msgspec.structs.replace(csv_run(readings, 7), watch=True)
    readings.write_text("a,b,c\n" + 7 * "1,0,1\n")
    log = recorded(options, tmp_path / "log.mcap")
    assert said_of(log) == "no anomalies in 7 ticks\n"
    assert said_of(log, "--json") == ""
