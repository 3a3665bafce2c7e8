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
