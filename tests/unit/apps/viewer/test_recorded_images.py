"""The last image at a tick or before is found, in whole and in growing recordings."""

from pathlib import Path

import pytest

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from tests.support.recorded_runs import in_chunks, recorded
from tests.support.run_options import options_for

TICKS = 40
EVERY = 6


def due(tick: int) -> int:
    return tick - (tick - 1) % EVERY


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = options_for(
        "neurosnap/FrozenLake-v0", 5, ticks=TICKS, cells="inline", frames=EVERY
    )
    folder = tmp_path_factory.mktemp("lake")
    return in_chunks(recorded(options, folder / "run.mcap"), folder / "cut.mcap", 9000)


def test_every_frame_names_its_image(log: Path) -> None:
    frames = RunView(log).frames(1, TICKS)
    assert [frame.image for frame in frames] == [due(t) for t in range(1, TICKS + 1)]


def test_it_is_found_while_the_recording_grows(log: Path, tmp_path: Path) -> None:
    data = log.read_bytes()
    ends = [c.offset + c.packed for c in Recording.open(log).files[0].layout.chunks]
    assert len(ends) > 5
    growing = tmp_path / "run.mcap"
    growing.write_bytes(data[: ends[0]])
    run_view = RunView(growing)
    for end in ends[1:]:
        growing.write_bytes(data[:end])
        run_view.grow()
        # That of the last tick is sent behind its observation, and may be to come.
        known = run_view.frames(1, run_view.last - 1)
        assert [frame.image for frame in known] == [due(f.tick) for f in known]
    assert run_view.last > TICKS // 2


def test_a_tick_that_has_none_has_the_one_before(log: Path) -> None:
    images = RunView(log).images
    for tick in (20, 1, 40, 13, 14):
        found = images.latest(tick)
        assert found is not None
        assert found.tick == due(tick)
        assert found.data.startswith(b"\x89PNG")
    assert images.latest(0) is None
