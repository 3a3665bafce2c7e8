"""A short soak of a run that is fed lines."""

import asyncio
from pathlib import Path

import pytest

from tools.soak.__main__ import soak_outside

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.exhaustive,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


def test_a_short_soak_of_a_run_that_is_fed_lines(tmp_path: Path) -> None:
    # This seed leaves the intake alone, whose death may cost what it has just read.
    found = asyncio.run(soak_outside("worker", 1, 25, tmp_path, rate=50.0))
    assert found.fine, found
    assert found.killed == {"recorder+world": 1}
    assert found.restarts >= 1
    assert found.fed is not None
    assert found.fed.lines == found.ticks > 0
