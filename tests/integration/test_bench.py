"""Each row of the benchmarks runs; what it measures is nobody's business here."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE

_BENCH = Path(__file__).parents[2] / "tools" / "bench.py"

pytestmark = [pytest.mark.bench, pytest.mark.slow, pytest.mark.zenoh]


def bench(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, str(_BENCH), "--quick", *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "row",
    [
        "spawn",
        "hop",
        "line",
        "recording",
        "observe",
        "learn",
        "cycle",
        "tick",
        "worker",
        "verify",
    ],
)
def test_a_row_runs(row: str) -> None:
    report = json.loads(bench("--only", row, "--json").splitlines()[-1])
    assert list(report["rows"]) == [row]
    for line in report["rows"][row]:
        assert line["figures"]
        assert all(math.isfinite(figure) for figure in line["figures"].values())


def test_a_markdown_table_has_a_line_a_measure() -> None:
    lines = bench("--only", "observe", "--markdown").splitlines()
    assert lines[0] == "| what | measured | against | reach |  |"
    assert len(lines) == 2 + 4
    assert len({line.count("|") for line in lines}) == 1


def test_an_unknown_row_is_named() -> None:
    done = subprocess.run(
        [sys.executable, str(_BENCH), "--only", "hop,skip"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 2
    assert "must be of spawn, hop, line" in done.stderr
    assert "got skip" in done.stderr
