"""Services that do not fit the run, or are called wrongly, are refused."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.services import CELLS, PATH, SMALL, SWARM, ended, going, hub_at, up

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


WRONG = {
    "more cells": (
        ("serve", "cells", SWARM, "4-9"),
        2,
        "cells: must be cells of the swarm, 0 to 5, got 9",
    ),
    "an empty range": (
        ("serve", "cells", SWARM, "6-"),
        2,
        "cells: must be cells of the swarm, 0 to 5, got 6",
    ),
    "another world": (
        ("serve", "world", SWARM, "neurosnap/Cycle-v0"),
        2,
        "source: must be what the coordinator runs, neurosnap/Path-v0, got",
    ),
    "a recorder": (("serve", "recorder", SWARM), 2, "got 'recorder'"),
    "the same cell": (
        ("serve", "cells", SWARM, "5"),
        1,
        "cell/5: must be there once, is in demo already",
    ),
    "a coordinator": (
        ("serve", "coordinator", PATH, "--swarm", SWARM),
        1,
        "swarm demo: must have one coordinator, has one already",
    ),
}


def test_who_does_not_fit_is_refused_and_the_run_minds_nothing(
    endpoint: str, tmp_path: Path
) -> None:
    at = ("--connect", endpoint)
    whole = ("serve", "coordinator", PATH, *at, "--swarm", SWARM, *SMALL, "--ticks", 20)
    with (
        going(*whole, "--set", "recording.record=false") as coordinator,
        going("serve", "cells", SWARM, *at, "0-5") as cells,
    ):
        up(endpoint, "coordinator", *(f"cell/{n}" for n in range(CELLS)))
        for name, (line, code, text) in WRONG.items():
            more = ("--out", tmp_path / "log") if line[1] == "recorder" else ()
            with going(*line, *more, *at) as wrong:
                assert text in ended(wrong, code), name
        with going("serve", "world", SWARM, PATH, *at) as world:
            assert "20 in" in ended(coordinator)
            ended(cells)
            ended(world)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (("serve", "cells", "a/b", "0"), "swarm: must be letters and digits"),
        (("serve", "cells", SWARM), "Missing argument 'RANGES'"),
        (("serve", "cells", SWARM, "3,3"), "cells: must name each once, got '3,3'"),
        (
            ("serve", "recorder", SWARM, "--out", "/nowhere/x"),
            "out: must be in a folder that",
        ),
        (
            ("serve", "coordinator", PATH, "--swarm", ""),
            "swarm: must be letters and digits",
        ),
        (
            ("serve", "world", SWARM, PATH, "--restart", "now"),
            "Invalid value for '--restart'",
        ),
    ],
    ids=lambda given: " ".join(map(str, given)) if isinstance(given, tuple) else "",
)
def test_wrong_usage_is_refused_at_once(line: tuple[str, ...], text: str) -> None:
    with going(*line, "--connect", "tcp/127.0.0.1:1") as wrong:
        assert text in ended(wrong, 2)
