"""The Python API runs a swarm; many checks on one run."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

import neurosnap
from neurosnap.errors import InvalidValueError
from neurosnap.recording.read.recording import Recording as RecordingFiles

TICKS = 40


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> neurosnap.Recording:
    out = tmp_path_factory.mktemp("library") / "path.mcap"
    return neurosnap.run(
        "neurosnap/Path-v0",
        out,
        arguments={"places": 6},
        ticks=TICKS,
        seed=7,
        threshold=0.1,
        cells="inline",
        settings={"recording.keyframe_every": 20},
    )


def test_a_run_returns_its_recording(recording: neurosnap.Recording) -> None:
    assert recording.whole
    assert recording.sensors == tuple(f"below_{k}" for k in range(1, 6))
    assert (recording.options.ticks, recording.options.keyframe_every) == (TICKS, 20)
    assert repr(recording) == f"Recording({str(recording.path)!r})"
    verdict = recording.verify(start=20)
    assert (verdict.same, verdict.start, verdict.ticks) == (True, 20, TICKS - 20)


def test_its_ticks_are_numbers_and_tables(recording: neurosnap.Recording) -> None:
    numbers = [tick.number for tick in recording.ticks()]
    assert numbers == list(range(1, TICKS + 1))
    table = recording.to_numpy()
    assert table.shape == (TICKS, 5)
    assert set(np.unique(table)) <= {0.0, 1.0}
    frame = recording.to_pandas()
    assert list(frame.index) == numbers
    assert np.array_equal(frame[list(recording.sensors)].to_numpy(float), table)
    assert frame["time"].is_monotonic_increasing
    assert len(recording.depths()) == sum(
        1 for _ in RecordingFiles.open(recording.path).messages(("state", "reached"))
    )


def test_what_it_learned_is_an_order_at_any_tick(
    recording: neurosnap.Recording,
) -> None:
    first, last = recording.order_at(0), recording.order_at()
    sensorium = recording.snapshot_at().sensorium
    assert first.implications(sensorium) == []
    assert ("below_1", "below_2") in last.implications(sensorium)
    assert recording.to_networkx().has_edge("below_1", "below_2")
    assert any(row.relation == "implies" for row in recording.relations_at())
    assert list(recording.anomalies()) == []


def test_a_run_goes_on(recording: neurosnap.Recording, tmp_path: Path) -> None:
    more = recording.resume(tmp_path / "more.mcap", ticks=TICKS + 5)
    assert [tick.number for tick in more.ticks()][-1] == TICKS + 5
    assert more.verify().same


async def test_it_runs_where_a_loop_is_running(tmp_path: Path) -> None:
    asyncio.get_running_loop()
    done = neurosnap.run(
        "neurosnap/Path-v0", tmp_path / "a.mcap", ticks=3, cells="inline"
    )
    assert done.whole


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"tick": 3}, "run: must be an option of a run: "),
        ({"ticks": 0}, "ticks: must be a whole number in [1, 2147483647], got 0"),
        ({"out": "no/such/folder.mcap"}, "out: must be in a folder that exists"),
        ({"settings": {"recording.record": False}}, "out: must go with a recording"),
        ({"arguments": {"places": "x"}}, "source.arguments.places: "),
    ],
)
def test_what_is_wrong_is_refused_by_its_name(
    given: dict[str, object], text: str, tmp_path: Path
) -> None:
    whole = {"out": tmp_path / "a.mcap", "cells": "inline", **given}
    with pytest.raises(InvalidValueError) as caught:
        neurosnap.run("neurosnap/Path-v0", **whole)  # type: ignore[arg-type]
    assert str(caught.value).startswith(text)
    assert list(tmp_path.iterdir()) == []
