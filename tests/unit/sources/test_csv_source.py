"""Files of readings as sources, and invalid files."""

from pathlib import Path

import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.meaning import RULE
from neurosnap.sources.open import open_source
from tests.support.sources import README, everything, written

NOTHING = "door,motion\n0,1\n,\n1,1\nNA,unknown\n1,0\n"
"""The same, with rows that say nothing: they are no ticks."""


@pytest.mark.parametrize(
    ("name", "text"), [("readings.csv", NOTHING), ("readings.txt", README)]
)
def test_rows_come_out_in_order_whatever_seeds_and_actions_say(
    tmp_path: Path, name: str, text: str
) -> None:
    path = written(tmp_path, text, name)  # another ending is found: it exists
    source = open_source(str(path), seed=9)
    assert source.sensors == ("door", "motion")
    assert source.actions == ()
    assert source.length == 3
    for actions in (None, iter([-1, 5, 7])):
        assert everything(source, actions) == [[0, 1], [1, 1], [1, 0]]
        assert source.step(0) is None
    # Only the first row begins a trajectory.
    several = iter([source.first(), source.step(0), source.step(0)])
    assert [one.begins for one in several if one] == [True, False, False]


def test_time_is_a_sensor_like_any_other_when_it_is_not_first(tmp_path: Path) -> None:
    source = open_source(str(written(tmp_path, "door,time\n0,1\n")), seed=0)
    assert source.sensors == ("door", "time")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "{}: must have a header of sensor names, got 'no text'"),
        ("\n\n", "{}: must have a header of sensor names, got 'no text'"),
        ("\ufeff", "{}: must have a header of sensor names, got 'no text'"),
        ("a,b\n", "{}: must hold readings, got 'none'"),
        ("a,b\n,\n", "{}: must hold readings, got 'none that is known'"),
        ("time\n1\n", "{}:1: must be a header of sensor names, got ['time']"),
        ("0,1\n1,1\n", "{}:1: must be a header of sensor names, got ['0', '1']"),
        ("a,,b\n0,1,1\n", "{}:1: sensor name: must not be empty, got ''"),
        ("a,b,a\n0,1,1\n", "{}:1: names: must be unique, got 'a'"),
        ("a,b*\n0,1\n", "{}:1: sensor name: must not end with *, got 'b*'"),
        ("a,b\n0,1\n0,2\n", f"{{}}:3: b: {RULE}, got '2'"),
        ("a,b\n0,1.5\n", f"{{}}:2: b: {RULE}, got '1.5'"),
        ("a,b\n0,１\n", f"{{}}:2: b: {RULE}, got '１'"),
        ("time,a,b\n0,1,x\n", f"{{}}:2: b: {RULE}, got 'x'"),
        ("a,b\n0;1\n", "{}:2: must have 2 cells, as many as the header, got 1"),
        ("a,b\n0,1\n0\n", "{}:3: must have 2 cells, as many as the header, got 1"),
        ("a,b\n0,1,\n", "{}:2: must have 2 cells, as many as the header, got 3"),
        ("a,b\n" + 898 * "0,1\n" + "0,7\n1,1\n", f"{{}}:900: b: {RULE}, got '7'"),
        (
            "a,b\n0,1\n\n\n0,1\n",
            "{}:3: must not be blank before the end of the file, got ''",
        ),
        (
            "\na,b\n0,1\n",
            "{}:1: must not be blank before the end of the file, got ''",
        ),
        (
            'a,b\n0,1\n0,"1\n',
            "{}:3: must be CSV, got 'unexpected end of data'",
        ),
        ("Tür,b\n0,1\n".encode("latin-1"), "{}: must be UTF-8 text, got b'"),
        (README.encode("utf-16"), "{}: must be UTF-8 text, got b'"),
        (
            README.encode() + 999 * b"1,1\n" + b"\xff,1\n",
            "{}: must be UTF-8 text, got b'",
        ),
    ],
)
def test_a_bad_file_is_refused_with_row_and_column(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises((InvalidValueError, ShapeError)) as caught:
        open_source(str(path), seed=0)
    said = str(caught.value)
    assert said.startswith(message.format(path))
    assert said == message.format(path) or isinstance(text, bytes)


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    zeros = written(tmp_path, "door\n0\n".encode("utf-16-le"), "zeros.csv")
    (tmp_path / "folder.csv").mkdir()
    for path, rule in (
        (zeros, r"zeros\.csv:1: "),
        (
            tmp_path / "none.csv",
            r"^source: must be a file that can be read \(No su",
        ),
        (tmp_path / "folder.csv", r"can be read \(Is a directory\).*folder\.csv"),
    ):
        with pytest.raises(InvalidValueError, match=rule):
            open_source(str(path), seed=0)
