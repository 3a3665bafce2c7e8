"""Tests of ``neurosnap export`` from the command line."""

import itertools
import signal
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from neurosnap.apps.export import table
from tests.support.command_line import call, happy
from tests.support.recorded_runs import TICKS

pytestmark = pytest.mark.slow


def test_a_table_goes_beside_the_recording_or_where_it_is_named(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(path_log.parent)
    for form, out in (("csv", ()), ("parquet", ("-o", "path.parquet"))):
        facts = happy("export", path_log.name, *out)
        assert facts == {
            "path": f"path.{form}",
            "ticks": TICKS,
            "incomplete": 0,
            "whole": True,
        }
        assert Path(facts["path"]).is_file()


def ended(number: signal.Signals, log: Path, out: Path) -> Result:
    """Export, and be sent a signal when half of it is written."""
    whole = table.write_csv

    def half(path: Path, columns: Any, rows: Any) -> None:
        whole(path, columns, itertools.islice(rows, TICKS // 2))
        signal.raise_signal(number)

    before = signal.getsignal(number)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("neurosnap.apps.export.table.write_csv", half)
        result = call("export", log, "-o", out)
    assert signal.getsignal(number) is before
    return result


@pytest.mark.parametrize(
    ("name", "ignored"),
    [("SIGINT", False), ("SIGTERM", False), ("SIGHUP", False), ("SIGHUP", True)],
)
def test_whatever_ends_it_leaves_nothing_behind_and_what_is_ignored_does_not(
    path_log: Path, tmp_path: Path, name: str, ignored: bool
) -> None:
    number, out = signal.Signals[name], tmp_path / "out.csv"
    # Whoever started the tests may have had them ignore it.
    ends = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    before = signal.signal(number, signal.SIG_IGN if ignored else ends)
    try:
        result = ended(number, path_log, out)
    finally:
        signal.signal(number, before)
    assert result.exit_code == (0 if ignored else 128 + number)
    assert list(tmp_path.iterdir()) == ([out] if ignored else [])
    assert ignored or result.stdout == ""
