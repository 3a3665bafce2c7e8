"""The command line of agents and experiments: it works, refuses, and can be stopped."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.command_line import call, facts_of
from tests.support.patience import PATIENCE

INLINE = ("--cells", "inline", "--ticks", 40, "--set", "places=5", "--format", "json")


@pytest.mark.parametrize(
    ("options", "cells"),
    [
        (("--agent", "walker"), 4),
        (("--agent", "excited"), 4 + 2 + 3 + 24),
        (("--agent", "excited", "--target", 2), 4 + 2 + 3 + 24),
        (("--agent", "planner", "--target", "below_3, below_2*"), 4 + 2 + 16),
        (("--agent", "planner", "--target", "below_3", "--set", "wait=true"), 31),
    ],
)
def test_every_agent_runs_and_its_recording_verifies(
    options: tuple[object, ...], cells: int, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    result = call("run", "neurosnap/Path-v0", *options, *INLINE, "--out", log)
    assert result.exit_code == 0, result.stderr
    facts = facts_of(result)
    assert (facts["ticks"], facts["cells"]) == (40, cells)
    verdict = facts_of(call("verify", log, "--format", "json"))
    assert (verdict["same"], verdict["complete"]) == (True, True)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--agent", "planner"), "target: must name a sensation to achieve"),
        (
            ("--agent", "planner", "--target", "below_9"),
            "target: must name a sensor that exists, got 'below_9'",
        ),
        (
            ("--agent", "planner", "--target", "below_1,below_1*"),
            "target: must not hold a literal and its complement, got 'below_1'",
        ),
        (
            ("--agent", "excited", "--target", "below_1"),
            "target: must be the number of a place for an excited agent",
        ),
        (("--agent", "excited", "--target", 5), "target: must be a place in 0..4"),
        (("--target", "below_1"), "target: must go with a planner or an excited"),
        (
            ("--agent", "excited", "--set", "agent.explore=1.5"),
            "explore: must be a number in [0, 1] or 'planned', got 1.5",
        ),
        (("--set", "colour=red"), "arguments: must be ones that neurosnap/Path-v0"),
        (("--set", "places"), "set: must be KEY=VALUE, got 'places'"),
        (("--set", "places=1"), "places: must be a whole number of at least 2, got 1"),
    ],
)
def test_an_agent_that_does_not_fit_is_refused(
    options: tuple[object, ...], text: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    result = call("run", "neurosnap/Path-v0", *INLINE, *options, "--out", log)
    assert result.exit_code == 2
    assert text in result.stderr
    assert not log.exists()


def test_a_file_moves_nobody(tmp_path: Path) -> None:
    readings = tmp_path / "readings.csv"
    readings.write_text("a,b\n0,1\n1,1\n", encoding="utf-8")
    result = call("run", readings, "--agent", "planner", "--target", "a")
    assert result.exit_code == 2
    assert "agent: must have actions that are sensors" in result.stderr
    result = call("run", readings, "--agent", "excited")
    assert result.exit_code == 2
    result = call("run", readings, "--set", "places=4")
    assert "arguments: must not be given for a file" in result.stderr


@pytest.mark.slow
def test_figures_say_what_they_found(tmp_path: Path) -> None:
    small = ("--runs", 2, "--steps", 60, "--out", tmp_path)
    result = call("figures", "--only", "agents-excited,3", *small, "--json")
    assert result.exit_code == 0, result.stderr
    facts = facts_of(result)
    assert (facts["computed"], facts["reused"], facts["missing"]) == (18, 0, 0)
    names = [figure["name"] for figure in facts["figures"]]
    assert names == ["learning-compared", "agents-excited"]
    for figure in facts["figures"]:
        assert all(Path(path).stat().st_size for path in figure["files"])
    again = call("figures", "--only", "4", *small)
    assert again.stdout.startswith("cells: 0 computed, 10 reused\n")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--runs", 0), "runs: must be at least 1, got 0"),
        (("--only", "nine"), "only: must be of learning-empirical,"),
        (("--seed", -1), "seed: must be at least 0, got -1"),
        (("--workers", -1), "workers: must be at least 1, got -1"),
    ],
)
def test_a_wrong_figure_is_refused(
    options: tuple[object, ...], text: str, tmp_path: Path
) -> None:
    result = call("figures", *options, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert text in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_interrupted_figures_keep_what_is_done(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "neurosnap", "figures", "--only", "1"]
    many = [
        "--runs",
        "40",
        "--steps",
        "20000",
        "--out",
        str(tmp_path),
        "--json",
    ]
    with subprocess.Popen(
        [*command, *many], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while not list((tmp_path / "cells").glob("*.npz")):
            assert process.poll() is None
            time.sleep(0.02)  # looking costs what the cells need
        process.send_signal(signal.SIGINT)
        stdout, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 3
    facts = json.loads(stdout.splitlines()[-1])
    kept = len(list((tmp_path / "cells").glob("*.npz")))
    assert facts["computed"] == kept > 0
    assert facts["missing"] == 40 - kept > 0
    assert not list(tmp_path.rglob("*.part*"))
