"""A run goes on when a part of it dies, also one on another host."""

import asyncio
from pathlib import Path

import pytest

from neurosnap.runtime import remote_parts
from neurosnap.runtime.network import Network
from neurosnap.runtime.remote_parts import Numbers
from neurosnap.runtime.request import Outcome, Site
from neurosnap.runtime.service import Served, serve
from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    check_same,
    options_for,
)
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]

ELSEWHERE = (1, 3)  # cells
SWARM = "demo"


def endpoint() -> str:
    """Where a hub may listen now."""
    return f"tcp/127.0.0.1:{free_port()}"


VICTIMS = (("coordinator",), ("cell/1",), ("hub",), ("recorder", "cell/3"))
"""The parts that die together, one row for each life of the run."""


def test_a_run_with_cells_elsewhere_comes_to_the_same(tmp_path: Path) -> None:
    options = options_for(ENDLESS)
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed, served, where = Disturbed(options, log), list[Served](), endpoint()

    async def both() -> Outcome:
        async with asyncio.TaskGroup() as group:
            group.create_task(
                serve(
                    remote_parts.cells(Numbers(ELSEWHERE)),
                    Network(connect=where),
                    SWARM,
                    asyncio.Event(),
                    patience=PATIENCE,
                    on_served=served.append,
                )
            )
            return await disturbed.running(
                *((20, victims) for victims in VICTIMS),
                site=Site(
                    Network(listen=where),
                    swarm=SWARM,
                    elsewhere=frozenset(f"cell/{cell}" for cell in ELSEWHERE),
                ),
            )

    outcome = asyncio.run(both())
    check_same(outcome, disturbed, log, options, calm)
    assert [one.swarm for one in served] == [
        "demo",
        *(f"demo-{life + 1}" for life in range(len(VICTIMS))),
    ]
    assert [bool(one.trouble) for one in served] == [True] * len(VICTIMS) + [False]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]
