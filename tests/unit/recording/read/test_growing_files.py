"""A run recorded in several files is looked at as one, and each file by itself."""

from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_path
from neurosnap.recording.write.writer import Writer
from tests.support.recorded_runs import TICKS, path_run, recorded

SPLIT = (14, 28)
"""Ticks whose key-frames begin a file."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


def shares(log: Path) -> list[list[Recorded]]:
    """Return the messages of each file, a key-frame first in all but the first."""
    parts: list[list[Recorded]] = [[]]
    for each in Recording.open(log).messages():
        if isinstance(each.message, wire.KeyFrame) and each.message.tick in SPLIT:
            parts.append([])
        parts[-1].append(each)
    return parts


def write(log: Path, part: int, messages: list[Recorded], target: Path) -> Writer:
    path = part_path(target, part)
    path.unlink(missing_ok=True)
    writer = Writer(path, chunk=2000)
    begins = str((0, *SPLIT)[part])
    facts = {**Recording.open(log).metadata, "part": str(part), "begins": begins}
    writer.start(facts)
    for each in messages:
        writer.add(each.delivery, each.log_time)
    writer.flush()
    return writer


@pytest.fixture(scope="module")
def split(log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("split") / "run.mcap"
    for part, messages in enumerate(shares(log)):
        write(log, part, messages, target).finish({}, {})
    return target


def test_all_files_are_looked_at_as_one(log: Path, split: Path) -> None:
    one, several = RunView(log), RunView(split)
    assert (several.first, several.last, several.cut) == (1, TICKS, None)
    assert several.frames(1, TICKS) == one.frames(1, TICKS)
    for tick in (40, 0, 13, 14, 15, 28, 29):
        assert several.graph(tick) == one.graph(tick)


def test_a_later_file_stands_for_itself(log: Path, split: Path) -> None:
    one, later = RunView(log), RunView(part_path(split, 1))
    first, last = SPLIT
    assert (later.first, later.last) == (first + 1, last)
    assert later.frames(1, TICKS) == [
        # The decision that ends the last tick is in the next file.
        frame
        for frame in later.frames(first + 1, last)
        if frame == one.frames(frame.tick, frame.tick)[0] or frame.tick == last
    ]
    assert later.graph(first + 1) == one.graph(first + 1)
    with pytest.raises(InvalidValueError, match=r"^tick: must be in \[15, 28\], got 9"):
        later.graph(9)


def test_files_that_come_and_grow_are_followed(log: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.mcap"
    parts = shares(log)
    view, writers = None, []
    for part, messages in enumerate(parts):
        late = messages[-5:]  # they come once the next file was begun
        writers.append(write(log, part, messages[:-5], target))
        if view is None:
            view = RunView(target)
        else:
            assert view.grow()
        assert view.frames(1, TICKS) == RunView(target).frames(1, TICKS)
        if part:
            writers[part - 1].finish({}, {})
            assert view.grow()
        for each in late:
            writers[part].add(each.delivery, each.log_time)
    writers[-1].finish({}, {})
    assert view is not None
    assert view.grow()
    assert not view.grow()
    assert view.recording.cut is None
    assert view.frames(1, TICKS) == RunView(log).frames(1, TICKS)
    assert view.graph(TICKS) == RunView(log).graph(TICKS)


def test_files_deleted_before_or_while_they_are_looked_at_are_left_out(
    log: Path, split: Path, tmp_path: Path
) -> None:
    target = tmp_path / "run.mcap"
    for part in (0, 1, 2):
        part_path(target, part).write_bytes(part_path(split, part).read_bytes())
    view = RunView(target)
    assert view.first == 1
    target.unlink()
    assert not view.recording.replaced()
    assert view.grow()
    assert (view.first, view.last) == (SPLIT[0] + 1, TICKS)
    assert view.frames(1, TICKS) == RunView(log).frames(view.first, TICKS)
    assert not view.grow()
    afresh = RunView(target)
    assert (afresh.first, afresh.last) == (view.first, view.last)
    assert afresh.frames(1, TICKS) == view.frames(1, TICKS)
    target.write_bytes(split.read_bytes())  # the run was taken up again from the start
    assert view.recording.replaced()


def test_a_file_in_which_nothing_is_written_yet_is_waited_for(
    split: Path, tmp_path: Path
) -> None:
    target = tmp_path / "run.mcap"
    target.write_bytes(split.read_bytes())
    view = RunView(target)
    next_ = part_path(target, 1)
    next_.touch()
    assert not view.grow()
    next_.write_bytes(part_path(split, 1).read_bytes())
    assert view.grow()
    assert view.last == SPLIT[1]
