"""Files are written whole or not at all; foreign and lost writes are detected."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.system.durable import OwnFile, replace_file


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


def test_a_full_disk_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "memory.npz"
    replace_file(path, b"old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
