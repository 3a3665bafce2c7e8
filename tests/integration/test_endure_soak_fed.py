"""A short soak of a run that is fed lines."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.disturbed_runs import no_part_is_left
from tools.soak.__main__ import soak_outside

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(autouse=True)
def no_process_is_left() -> Iterator[None]:
    with no_part_is_left():
        yield


def test_a_short_soak_of_a_run_that_is_fed_lines(tmp_path: Path) -> None:
    # This seed leaves the intake alone, whose death may cost what it has just read.
    found = asyncio.run(soak_outside("worker", 1, 25, tmp_path, rate=50.0))
    assert found.fine, found
    assert found.killed == {"recorder+world": 1}
    assert found.restarts >= 1
    assert found.fed is not None
    assert found.fed.lines == found.ticks > 0
