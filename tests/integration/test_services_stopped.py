"""Each service of a swarm can be stopped in the midst of a run."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from neurosnap.recording.replay.verify import verify
from tests.support.exhaustive import rows
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.services import ENDLESS, PATH, SWARM, begun, ended, going, hub_at

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


PARTS = ("coordinator", "world", "cells", "recorder")


@pytest.mark.parametrize("who", rows(["recorder"], ["coordinator", "world", "cells"]))
def test_each_of_them_can_be_stopped_in_the_midst(
    who: str, endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    stay = ("--restart", "never")
    lines: dict[str, tuple[object, ...]] = {
        "coordinator": (PATH, "--swarm", SWARM, *ENDLESS, "--set", "cells.deadline=1"),
        "world": (SWARM, PATH, *stay),
        "cells": (SWARM, "0-5", *stay),
        "recorder": (SWARM, "--out", log, *stay),
    }
    with ExitStack() as stack:
        parts = {
            part: stack.enter_context(going("serve", part, *line, *at))
            for part, line in lines.items()
        }
        begun(endpoint, 5)
        parts[who].send_signal(signal.SIGINT)
        # Whoever stops the coordinator or the world ends the run in order; who takes
        # cells or the recorder away makes it fail.
        in_order = who in ("coordinator", "world")
        said = ended(parts["coordinator"], 0 if in_order else 1)
        for name in PARTS[1:]:
            parts[name].communicate(timeout=PATIENCE)
            if name != "recorder":
                assert parts[name].returncode == 0
    if who == "recorder":
        assert "recorder: must stay until the run ends, is gone" in said
        assert parts["recorder"].returncode == 3
        assert not verify(log).complete
    if in_order:
        assert parts["recorder"].returncode == 0
        verdict = verify(log)
        assert (verdict.same, verdict.complete) == (True, True)
    assert verify(log).ticks >= 4
