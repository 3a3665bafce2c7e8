"""A recording cut short is incomplete where it is derived again, never different."""

import random
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from tests.support.lossy_runs import LOST, Simulation, lost_once
from tests.support.recorded_messages import first
from tests.support.replayed_runs import Runs, options_for
from tests.support.rewritten_recordings import write_again
from tests.support.shuffled_recordings import shuffled

if TYPE_CHECKING:
    from collections.abc import Iterable

    from neurosnap.recording.read.chunk_messages import Recorded

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


def offsets(log: Path, count: int) -> list[int]:
    """Return places to cut at: round every chunk's end, and drawn ones."""
    size = log.stat().st_size
    chunks = Recording.open(log).files[0].layout.chunks
    edges = [chunk.offset + step for chunk in chunks for step in (-1, 0, 1)]
    chance = random.Random(3)
    drawn = [chance.randrange(size) for _ in range(count)]
    return sorted({*chance.sample(edges, min(count, len(edges))), *drawn, size - 1})


def cut_at(log: Path, target: Path, size: int) -> Path:
    target.write_bytes(log.read_bytes()[:size])
    return target


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_recording_cut_anywhere_is_incomplete_and_never_different(
    runs: Runs, tmp_path: Path, seed: int | None
) -> None:
    recording = Recording.open(runs.of("csv").log)
    recorded: Iterable[Recorded] = list(recording.messages())
    if seed is not None:
        recorded = shuffled(seed)(list(recorded))
    whole = write_again(recording, tmp_path / "log", recorded, chunk=1500)
    first_chunk = Recording.open(whole).files[0].layout.chunks[0].offset
    ticks = set()
    for size in offsets(whole, 30):
        cut = cut_at(whole, tmp_path / "cut", size)
        try:
            verdict = verify(cut)
        except RecordingError:  # it says little or nothing of its run
            assert size < first_chunk
            continue
        assert verdict.difference is None, f"cut at {size}: {verdict.difference}"
        assert not verdict.complete, f"cut at {size}"
        ticks.add(verdict.ticks)
    assert len(ticks) > (5 if seed is None else 1)


@pytest.mark.parametrize("what", ["pulse", "start"])
def test_a_cut_recording_of_a_repeated_wave_is_never_different(
    runs: Runs, tmp_path: Path, what: str
) -> None:
    log = tmp_path / "log"
    Simulation(options_for(runs.csv), log, 1, lost_once(LOST[what])).run()
    recording = Recording.open(log)
    recorded = list(recording.messages())
    repeat, _ = first(recorded, wire.WaveStart, lambda w: w.repeats > 0)
    for end in range(repeat - 12, repeat + 12):
        cut = tmp_path / f"{end}.mcap"
        with Writer(cut) as writer:  # left without an end
            writer.start(recording.metadata)
            for each in recorded[:end]:
                writer.add(each.delivery, each.log_time)
        verdict = verify(cut)
        assert verdict.difference is None, f"cut after {end}: {verdict.difference}"
        assert not verdict.complete
