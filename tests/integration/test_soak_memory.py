"""In a long run memory stays constant and the recording is split into files."""

import asyncio
import json
from pathlib import Path

import msgspec
import pytest

from neurosnap.protocol.run_options import SMALLEST, CellKind
from tests.support.disturbed_runs import options_for
from tests.support.exhaustive import rows
from tools.soak.__main__ import main, soak
from tools.soak.memory import Gauge

pytestmark = pytest.mark.slow
TICKS = 500  # a chunk is full after 100 of them, and a file after 200 or so


@pytest.mark.zenoh
@pytest.mark.parametrize("cells", rows(["inline"], ["worker"]))
def test_a_short_long_run(cells: CellKind, tmp_path: Path) -> None:
    options = msgspec.structs.replace(
        options_for(TICKS),
        cells=cells,
        workers=2 if cells == "worker" else 0,  # cells say more than one worker
        keyframe_every=100,
        split=SMALLEST,
    )
    found = asyncio.run(soak(options, 0, 0, tmp_path, pause=0.05))
    assert found.fine, found
    assert found.ticks == TICKS
    assert found.files > 1
    assert found.recorded > SMALLEST
    kinds = {"launcher"}
    if cells == "worker":
        kinds |= {"hub", "recorder", "coordinator", "world", "worker"}
    assert found.memory.keys() == kinds
    assert all(0 < one.begin <= one.most for one in found.memory.values())


def test_growth_is_told_from_a_start_that_takes_memory() -> None:
    gauge = Gauge(1.0)
    for tick in range(1, 1001):
        gauge.tick = tick
        loaded = 10**6 + 10**5 * min(tick, 50)
        gauge.samples.append((tick, {"steady": loaded, "leaky": loaded + 8 * tick}))
    memory = gauge.memory()
    assert memory["steady"].slope == pytest.approx(0.0, abs=1e-6)
    assert memory["leaky"].slope == pytest.approx(8.0)
    assert memory["leaky"].end - memory["leaky"].begin == 8 * 900


@pytest.mark.exhaustive
def test_it_can_be_ended_early_and_says_what_it_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = "--fault none --cells inline --ticks 100000 --sensors 3 --seconds 0.5 --pause 0.05 --json"
    assert main([*given.split(), "--folder", str(tmp_path)]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    found = json.loads(last)
    assert 0 < found["ticks"] < 100_000
    assert found["verified"]
    assert list(tmp_path.iterdir()) == []
