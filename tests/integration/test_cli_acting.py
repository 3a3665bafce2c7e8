"""The command line of agents and experiments: it works, refuses, and can be stopped."""

from pathlib import Path

import pytest

from tests.support.command_line import call, facts_of

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
