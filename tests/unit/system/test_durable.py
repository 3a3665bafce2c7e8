"""A file detects writes by other programs, and data that its disk has lost."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.system.durable import OwnFile


@pytest.fixture
def own(tmp_path: Path) -> Iterator[OwnFile]:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    with OwnFile(os.open(tmp_path / "own", flags)) as file:
        file.write(b"a" * 100)
        yield file


def test_what_nobody_touches_is_as_written(own: OwnFile) -> None:
    for _ in range(3):
        own.read_back()
        own.write(b"b")
        assert own.is_as_written()
    own.read_back(whole=True)
    assert own.is_as_written()


def test_a_hole_that_is_written_behind_is_noticed_although_the_length_is_right(
    own: OwnFile, tmp_path: Path
) -> None:
    os.truncate(tmp_path / "own", 0)
    own.write(b"b" * 100)
    assert (tmp_path / "own").stat().st_size == 200
    assert not own.is_as_written()


def test_a_disk_that_gives_nothing_back_is_noticed(
    own: OwnFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("neurosnap.system.durable.checksum_of", fail)
    own.read_back()
    assert not own.is_as_written()
