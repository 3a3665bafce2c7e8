"""A journal reads back as written, or as a correct prefix."""

import contextlib
import errno
import os
import random
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.live.journal import (
    Begin,
    Journal,
    JournalRow,
    cut,
    decoded,
    framed,
    read_journal,
    records,
)

NAMES = ["door", "motion"]
SOME = st.lists(st.binary(max_size=40), max_size=8)


@given(SOME, st.data())
def test_what_is_cut_off_anywhere_leaves_a_right_beginning(
    several: list[bytes], data: st.DataObject
) -> None:
    whole = b"".join(map(framed, several))
    end = data.draw(st.integers(0, len(whole)))
    found = [*records(whole[:end])]
    assert found == several[: len(found)]
    ends = [len(b"".join(map(framed, several[:n]))) for n in range(len(several) + 1)]
    assert len(found) == sum(each <= end for each in ends) - 1


@given(SOME.filter(bool), st.data())
def test_a_flipped_bit_hides_records_and_changes_none(
    several: list[bytes], data: st.DataObject
) -> None:
    damaged = bytearray(b"".join(map(framed, several)))
    bit = data.draw(st.integers(0, 8 * len(damaged) - 1))
    damaged[bit // 8] ^= 1 << bit % 8
    found = [*records(bytes(damaged))]
    assert len(found) < len(several)
    assert found == several[: len(found)]


@given(st.binary(max_size=200))
@example(b"\x91\xa7\0\0\0\0\0\0\x80")  # a text that is none
def test_any_bytes_are_records_or_none(data: bytes) -> None:
    assert [*decoded(data)] == []
    assert [*decoded(framed(data))] == []


def written(folder: Path, count: int) -> Journal:
    journal = Journal(folder, NAMES)
    for number in range(count):
        journal.write(row(number + 1))
    return journal


def row(number: int) -> JournalRow:
    return JournalRow(number, bytes([(number - 1) % 4]), b"\3", number == 1)


def numbers(folder: Path) -> list[int]:
    return [row.number for row in read_journal(folder).rows]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run.mcap.journal"


def test_a_row_out_of_turn_ends_its_file() -> None:
    begin = Begin(("door", "motion"), 1, -1)
    written = [begin, row(1), row(3), row(4)]
    data = b"".join(framed(msgspec.msgpack.encode(one)) for one in written)
    assert [*decoded(data)] == [begin, row(1)]


def test_rows_written_anew_take_the_place_of_those_that_were_there(
    folder: Path,
) -> None:
    journal = written(folder, 5)
    journal.restart(2, [row(9)])
    journal.close()
    assert numbers(folder) == [1, 2, 3]


def test_what_was_done_is_known_once_its_file_is_deleted(folder: Path) -> None:
    journal = written(folder, 200)
    assert journal.begin_action(199)
    for number in range(200, 600):
        journal.write(row(number + 1))
    journal.close()
    cut(folder, 600)
    assert numbers(folder)[0] == 513
    assert read_journal(folder).acted == 199


def test_files_are_cut_off_once_all_their_rows_are_safe(folder: Path) -> None:
    cut(folder, 5)  # it need not be there
    assert not folder.exists()
    journal = written(folder, 600)
    for tick, first in (255, 1), (256, 257), (600, 513):  # the last is being written
        cut(folder, tick)
        assert numbers(folder)[0] == first
    rows = [row(number) for number in range(591, 601)]
    assert journal.rows_after(590) == (row(590), rows, 0)
    journal.close()


@pytest.mark.parametrize("damage", ["cut", "flipped", "zeroed"])
@pytest.mark.parametrize("at", [0.0, 0.3, 0.6, 0.999])
def test_a_damaged_file_costs_its_rows_from_there_on_and_no_more(
    folder: Path, damage: str, at: float
) -> None:
    written(folder, 600).close()
    first, *_ = sorted(folder.iterdir())
    data = bytearray(first.read_bytes())
    place = int(at * len(data))
    match damage:
        case "cut":
            del data[place:]
        case "flipped":
            data[place] ^= 1
        case _:
            data[place:] = bytes(len(data) - place)
    first.write_bytes(data)
    kept = read_journal(folder).rows
    left = [each for each in kept if each.number <= 256]
    assert left == [row(number) for number in range(1, len(left) + 1)]
    assert len(left) < 256
    assert [*kept[len(left) :]] == [row(number) for number in range(257, 601)]


def test_what_is_missing_is_counted_and_the_rest_follows_on(folder: Path) -> None:
    written(folder, 600).close()
    first, *_ = sorted(folder.iterdir())
    first.unlink()
    journal = Journal(folder, NAMES)
    _, rows, missing = journal.rows_after(250)
    assert missing == 6
    assert [each.number for each in rows] == [*range(251, 251 + 344)]
    assert rows[0].bits == row(257).bits
    assert journal.last == 594
    journal.close()
    assert numbers(folder) == [*range(251, 595)]


def test_a_recording_that_is_further_than_the_journal_goes_on_behind_it(
    folder: Path,
) -> None:
    journal = written(folder, 3)
    before, rows, missing = journal.rows_after(10)
    assert (before, rows, missing) == (None, [], 0)
    journal.write(JournalRow(0, b"\1", b"\3", False))
    journal.close()
    assert numbers(folder)[-1] == 11


def test_a_journal_of_other_sensors_is_refused(folder: Path) -> None:
    written(folder, 1).close()
    modes = [path.stat().st_mode & 0o777 for path in (folder, *folder.iterdir())]
    assert modes == [0o700, 0o600]  # only its owner may read it
    with pytest.raises(InvalidValueError, match=r"^journal: must be of the sensors"):
        Journal(folder, ["window"])


def test_a_full_disk_is_named_and_leaves_whole_rows(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = written(folder, 2)
    write = os.write
    room = 7  # bytes that still go in

    def full(descriptor: int, data: bytes) -> int:
        nonlocal room
        if not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        some = write(descriptor, data[:room])
        room -= some
        return some

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        rule = (
            r"^journal: must be writable, got No space left on device for '.*journal'"
        )
        with pytest.raises(NeurosnapError, match=rule):
            journal.write(JournalRow(0, b"\0", b"\3", False))
    journal.write(JournalRow(0, b"\2", b"\3", False))
    journal.close()
    assert read_journal(folder).rows == (row(1), row(2), row(3))


class Disk:
    """Remembers what of a folder's files would survive a power cut."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.synced: dict[str, int] = {}
        self.named: set[str] = set()
        fsync = os.fsync

        def noted(descriptor: int) -> None:
            fsync(descriptor)
            path = Path(f"/proc/self/fd/{descriptor}").readlink()
            if path.is_dir():
                self.named |= {each.name for each in path.iterdir()}
            else:
                self.synced[path.name] = path.stat().st_size

        monkeypatch.setattr(os, "fsync", noted)

    def cut(self, folder: Path, left: Path, chance: random.Random) -> None:
        """Put into `left` what a power cut might leave of `folder`."""
        left.mkdir()
        for path in folder.iterdir():
            data = bytearray(path.read_bytes())
            safe = self.synced.get(path.name, 0)
            at = chance.randint(safe, len(data))
            if chance.random() < 0.5:
                del data[at:]
            else:  # the length is there, and not all of what was written
                data[at:] = bytes(len(data) - at)
            if path.name in self.named or chance.random() < 0.5:
                (left / path.name).write_bytes(data)


@pytest.mark.parametrize("seed", range(12))
def test_a_power_cut_costs_no_row_that_was_synced(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chance, disk = random.Random(seed), Disk(monkeypatch)
    folder, left = tmp_path / "run.mcap.journal", tmp_path / "left"
    journal, safe, first = Journal(folder, NAMES), 0, 1
    for number in range(1, chance.randrange(300, 900)):
        journal.write(row(number))
        if chance.random() < 0.02:
            journal.sync()
            safe = number
        if chance.random() < 0.005:
            cut(folder, chance.randint(0, safe))
            first = numbers(folder)[0]
    disk.cut(folder, left, chance)
    journal.close()
    found = read_journal(left).rows
    assert [*found] == [row(number) for number in range(first, first + len(found))]
    assert first + len(found) > safe
    # A run that goes on with it writes behind what is left.
    with contextlib.closing(Journal(left, NAMES)) as again:
        assert again.write(JournalRow(0, b"\1", b"\3", True)).number == first + len(
            found
        )
