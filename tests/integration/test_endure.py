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


@pytest.mark.parametrize(
    "victims",
    [
        ("cell/2",),
        ("hub",),
        ("recorder",),
        ("coordinator",),
        ("world",),
        ("recorder", "coordinator"),
        ("hub", "recorder", "world", "cell/0"),
    ],
    ids="+".join,
)
def test_whoever_dies_the_run_comes_to_the_same(
    victims: tuple[str, ...], tmp_path: Path
) -> None:
    options = options_for(ENDLESS)
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log)
    outcome = disturbed.run((20, victims), (20, victims))
    assert disturbed.restarts[0].why.startswith(tuple(victims))
    check_same(outcome, disturbed, log, options, calm)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]
