"""Workers from the command line: runs, depths, and what is refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.commands import Command
from tests.support.patience import PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]

PATH = "neurosnap/Path-v0"


def facts(folder: Path, *arguments: object) -> dict[str, Any]:
    """Run a command in a process of its own; return the object it prints last."""
    with Command(*arguments, "--format", "json", folder=folder) as command:
        output, errors = command.communicate(PATIENCE)
        assert command.wait(PATIENCE) == 0, errors
    found: dict[str, Any] = json.loads(output.splitlines()[-1])
    return found


def test_a_run_in_workers_verifies_and_goes_on(tmp_path: Path) -> None:
    shared = ("--cells", "worker", "--workers", 3)
    log, more = tmp_path / "log.mcap", tmp_path / "more.mcap"
    run = facts(tmp_path, "run", PATH, *shared, "--ticks", 30, "--out", log)
    assert (run["ticks"], run["complete"]) == (30, True)
    verdict = facts(tmp_path, "verify", log)
    assert (verdict["same"], verdict["complete"]) == (True, True)
    assert verdict["wirings"] > 3
    facts(tmp_path, "resume", log, "--ticks", 45, "--out", more)
    verdict = facts(tmp_path, "verify", more)
    assert (verdict["same"], verdict["ticks"]) == (True, 45)


def test_depth_is_measured_in_workers(tmp_path: Path) -> None:
    shared = ("--cells", "worker", "--waves", 2, "--sensors", 600)
    chains = facts(tmp_path, "depth", *shared, "--heights", "1,40")
    assert [row["depth"] for row in chains["rows"]] == [1, 1, 40, 40]
    order = ("--edges", 4000, "--seed", 4, "--workers", 3, "--heights", "5,20")
    random = facts(tmp_path, "depth", *shared, *order, "--force")
    assert [row["depth"] for row in random["rows"]] == [5, 5, 20, 20]
    assert {row["pulses"] for row in random["rows"]} == {2000}
