"""A file that is over reaches the disk while the next one is being written."""

import errno
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from tests.support.split_runs import EVERY, SMALL, upto


class Disk:
    """A disk that takes nothing before it is told to."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.asked = threading.Event()
        self.takes = threading.Event()
        self.error: OSError | None = None
        self.threads: list[int] = []
        patch.setattr("os.fsync", self._sync)

    def _sync(self, _: int) -> None:
        self.threads.append(threading.get_ident())
        self.asked.set()
        assert self.takes.wait(10)
        if self.error is not None:
            raise self.error


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    made = Disk(monkeypatch)
    yield made
    made.takes.set()


def test_recording_goes_on_while_the_disk_takes_a_file(
    whole: Path, tmp_path: Path, disk: Disk
) -> None:
    old, log = Recording.open_file(whole), tmp_path / "log.mcap"
    recorded = list(old.messages())
    shares = upto(recorded, 2 * EVERY)
    with SplitWriter(log, old.metadata, split=SMALL) as writer:
        for count, one in enumerate(shares):
            writer.add(one.delivery, 10**18 + count)
        assert disk.asked.wait(10)
        writer.flush(10**18 + len(shares))
        # Whoever is killed now has lost nothing: the file that is over has its end, and
        # so the run goes on from the next one.
        assert Recording.open_file(log).cut is None
        assert Recording.open_file(log).completeness().whole
        assert find_resume_point(log)[1].part == 1
        assert threading.get_ident() not in disk.threads
        disk.takes.set()
        for count, one in enumerate(recorded[len(shares) :], len(shares)):
            writer.add(one.delivery, 10**18 + count)
        writer.finish({}, old.noted().expected)
    assert (verify(log).same, verify(log).complete) == (True, True)


def test_a_file_that_the_disk_does_not_take_ends_the_recording(
    whole: Path, tmp_path: Path, disk: Disk
) -> None:
    old, log = Recording.open_file(whole), tmp_path / "log.mcap"
    disk.error = OSError(errno.EIO, "no disk")
    with SplitWriter(log, old.metadata, split=SMALL) as writer:
        for count, one in enumerate(upto(list(old.messages()), 2 * EVERY)):
            writer.add(one.delivery, 10**18 + count)
        disk.takes.set()
        with pytest.raises(RecordingError, match=r"^log: must take .* got no disk"):
            writer.finish({}, {})


def test_files_are_deleted_once_a_newer_one_is_saved(
    whole: Path, tmp_path: Path, disk: Disk
) -> None:
    old, log = Recording.open_file(whole), tmp_path / "log.mcap"
    with SplitWriter(log, old.metadata, split=Split(1, keep=1)) as writer:
        for count, one in enumerate(upto(list(old.messages()), 2 * EVERY)):
            writer.add(one.delivery, 10**18 + count)
        assert disk.asked.wait(10)
        assert list(part_paths(log)) == [0, 1]
        disk.takes.set()
        writer.finish({}, {})
    assert list(part_paths(log)) == [1]
