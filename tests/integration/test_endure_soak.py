"""A short soak: a run of which each role and each pair of them is killed."""

import asyncio
from pathlib import Path

import msgspec
import pytest

from tests.support.disturbed_runs import options_for
from tools.soak.__main__ import SERVICES, soak

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.exhaustive,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


def test_a_short_soak(tmp_path: Path) -> None:
    every = len(SERVICES) + 1
    kills = every + every * (every - 1) // 2
    found = asyncio.run(soak(options_for(1), kills, 7, tmp_path))
    assert found.fine, found
    assert found.restarts >= kills == len(found.killings)
    # Each role once, and each pair.
    assert set(found.killed.values()) == {1}
    assert len(found.killed) == kills


def test_a_short_soak_of_workers_that_share_the_learning(tmp_path: Path) -> None:
    given = {"cells": "worker", "workers": 2, "learning": "spread"}
    shared = {"keyframe_every": 20, "band": 2, "split": 1 << 16, **given}
    options = msgspec.structs.replace(options_for(1), **shared)
    every = len(SERVICES) + 1
    found = asyncio.run(soak(options, every, 11, tmp_path))
    assert found.fine, found
    assert found.restarts >= every == len(found.killings)
