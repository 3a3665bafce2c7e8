"""Whole swarms compute the same in processes and inline, and what is right."""

import asyncio
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.protocol.run_options import (
    CellKind,
    RunOptions,
    SnapshotKind,
    WiringKind,
)
from neurosnap.sensorium import unpack
from tests.support.played_runs import (
    SEED,
    TICKS,
    Played,
    options_for,
    play,
    write_readings,
)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]


@pytest.fixture
def readings(tmp_path: Path) -> str:
    return write_readings(tmp_path / "readings.csv", TICKS)


async def test_the_same_seed_gives_the_same_recording(
    readings: str, tmp_path: Path
) -> None:
    for source in (readings, "neurosnap/Path-v0"):
        options = options_for(source)
        first, second = [
            await play(options, tmp_path / f"{number}-{Path(source).stem}.mcap")
            for number in range(2)
        ]
        topics = ("observe", "wiring", "wave", "state", "reach", "decide", "keyframe")
        assert first.payloads(*topics) == second.payloads(*topics)
        assert len(first.states) == TICKS
        assert first.recording.cut is None
        assert first.recording.completeness().whole


async def test_the_seed_matters(tmp_path: Path) -> None:
    options = options_for("neurosnap/Path-v0")
    other = msgspec.structs.replace(options, seed=SEED + 1)
    first = await play(options, tmp_path / "first.mcap")
    second = await play(other, tmp_path / "second.mcap")
    assert first.states != second.states
    assert first.decisions != second.decisions


def expected_states(played: Played, options: RunOptions) -> list[list[bool]]:
    """Return what the snapshot says by itself of what was observed."""
    snapshot = options.new_snapshot()
    observed = played.of(wire.Observation)
    sensors = len(options.sensors)
    return [snapshot.observe(unpack(o.bits, sensors)).tolist() for o in observed]


async def check_alike(
    source: str,
    tmp_path: Path,
    kinds: Sequence[tuple[CellKind, WiringKind]],
    snapshot: SnapshotKind = "empirical",
) -> Played:
    """Play `source` in each way; all must come to the same, and to what is right."""
    reference: Played | None = None
    for cells, wiring in kinds:
        options = options_for(source, cells=cells, wiring=wiring, snapshot=snapshot)
        played = await play(options, tmp_path / f"{cells}-{wiring}.mcap")
        assert played.recording.completeness().whole
        literals = 2 * len(options.sensors)
        states = [unpack(s.literals, literals).tolist() for s in played.of(wire.State)]
        assert len(states) == TICKS
        assert states == expected_states(played, options)
        if reference is not None:
            assert played.states == reference.states
            assert played.reached == reference.reached
            assert played.decisions == reference.decisions
        reference = reference or played
    assert reference is not None
    return reference


EVERY_WAY: list[tuple[CellKind, WiringKind]] = [
    ("inline", "hasse"),
    ("inline", "derived"),
    ("process", "hasse"),
    ("process", "derived"),
]


async def test_processes_and_tasks_and_both_wirings_come_to_the_same(
    readings: str, tmp_path: Path
) -> None:
    played = await check_alike(readings, tmp_path, EVERY_WAY)
    assert any(incoherent for _, _, incoherent in played.states)
    assert any(state.height > 0 for state in played.of(wire.State))


async def test_a_world_that_is_acted_on_goes_the_same_way(tmp_path: Path) -> None:
    ways = [EVERY_WAY[0], EVERY_WAY[2]]
    played = await check_alike("neurosnap/Path-v0", tmp_path, ways)
    assert {decision.action for decision in played.decisions[1:]} == {0, 1}
    assert max(reached.depth for reached in played.of(wire.Reached)) > 3


async def test_discounted_weights_come_to_the_same(
    readings: str, tmp_path: Path
) -> None:
    for source in (readings, "neurosnap/Path-v0"):
        folder = tmp_path / Path(source).stem
        folder.mkdir()
        await check_alike(source, folder, EVERY_WAY[:2], "discounted")


async def test_two_runs_at_once_do_not_notice_each_other(
    readings: str, tmp_path: Path
) -> None:
    sources = {"a": readings, "b": "neurosnap/Path-v0"}
    tasks: dict[str, asyncio.Task[Played]] = {}
    async with asyncio.TaskGroup() as group:
        for name, source in sources.items():
            options = options_for(source, cells="process", ticks=20)
            log = tmp_path / f"{name}.mcap"
            tasks[name] = group.create_task(play(options, log))
    for name, source in sources.items():
        together = tasks[name].result()
        alone = await play(options_for(source, ticks=20), tmp_path / f"{name}0.mcap")
        assert together.states == alone.states
        assert together.decisions == alone.decisions
        assert together.recording.completeness().whole
        assert together.of(wire.Fault) == []
