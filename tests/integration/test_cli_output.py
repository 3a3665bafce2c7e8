"""Printed output fits any terminal and stops quietly when the pipe is closed."""

import io
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from neurosnap.__main__ import main

READINGS = "tür,motør☃\n" + "1,1\n0,1\n0,0\n" * 30 + "1,0\n"
"""tür implies motør☃, until it does not."""


class Ended(NamedTuple):
    code: object
    out: bytes
    err: str


def call(*arguments: object, encoding: str = "utf-8") -> Ended:
    """Run a command on a terminal that has `encoding`."""
    out, err = io.BytesIO(), io.BytesIO()
    terminal = io.TextIOWrapper(out, encoding=encoding)
    code = _call(arguments, terminal, io.TextIOWrapper(err, encoding=encoding))
    terminal.flush()
    return Ended(code, out.getvalue(), err.getvalue().decode(encoding))


def _call(
    arguments: tuple[object, ...], out: io.TextIOBase, err: io.TextIOBase
) -> object:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["neurosnap", *map(str, arguments)])
        patch.setattr(sys, "stdout", out)
        patch.setattr(sys, "stderr", err)
        with pytest.raises(SystemExit) as ended:
            main()
        err.flush()
        return ended.value.code


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("output") / "readings.csv"
    path.write_text(READINGS, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def log(readings: Path) -> Path:
    """Return a recording with implications and with an anomaly."""
    log = readings.with_name("a.mcap")
    ended = call("run", readings, "--cells", "inline", "--out", log)
    assert ended.code == 0, ended.err
    return log


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("utf-8", "tür → motør☃"),
        ("latin-1", "tür \\u2192 motør\\u2603"),
        ("ascii", "t\\xfcr \\u2192 mot\\xf8r\\u2603"),
    ],
)
def test_a_run_is_told_of_in_the_letters_a_terminal_has(
    encoding: str, names: str, readings: Path
) -> None:
    few = readings.with_name("few.csv")
    few.write_text("".join(READINGS.splitlines(keepends=True)[:-1]), encoding="utf-8")
    flags = ("--cells", "inline", "--set", "recording.record=false")
    ended = call("run", few, *flags, encoding=encoding)
    assert (ended.code, ended.err) == (0, "")
    assert names in ended.out.decode(encoding)


@pytest.mark.parametrize("verb", ["info", "watch"])
def test_what_programs_read_is_utf_8_on_any_terminal(verb: str, log: Path) -> None:
    ended = call(verb, log, "--format", "json", encoding="latin-1")
    assert ended.code == 0
    last = ended.out.decode("utf-8").splitlines()[-1]
    assert "motør☃" in last
    json.loads(last)


@pytest.mark.parametrize(
    "verb",
    [("watch",), ("watch", "--format", "json"), ("learn",), ("info",), ("verify",)],
)
def test_nothing_is_said_to_who_has_read_enough(
    verb: tuple[str, ...], log: Path
) -> None:
    name, *flags = verb
    reading, writing = os.pipe()
    os.close(reading)  # as `| head -1` does once it has its line
    out, err = os.fdopen(writing, "w"), io.StringIO()
    assert _call((name, log, *flags), out, err) == 1
    assert err.getvalue() == ""
    with suppress(BrokenPipeError):  # by what was never written
        out.close()
