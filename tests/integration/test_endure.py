"""A run goes on when a part of it dies, and comes to the same."""

from pathlib import Path

import pytest

from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    check_same,
    options_for,
)

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


VICTIMS = (
    ("cell/2",),
    ("hub",),
    ("recorder",),
    ("coordinator",),
    ("world",),
    ("recorder", "coordinator"),
    ("hub", "recorder", "world", "cell/0"),
)
"""The parts that die together, one row for each life of the run."""


def test_a_run_of_which_each_part_dies_comes_to_the_same(tmp_path: Path) -> None:
    options = options_for(ENDLESS)
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log)
    outcome = disturbed.run(*((20, victims) for victims in VICTIMS))
    assert len(disturbed.flushed) == len(VICTIMS)
    for restart, victims in zip(disturbed.restarts, VICTIMS, strict=True):
        assert restart.why.startswith(victims)
    check_same(outcome, disturbed, log, options, calm)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]
