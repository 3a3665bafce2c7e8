"""Spans are when sensors were on, whatever form the times have."""

from pathlib import Path

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import Columns
from neurosnap.sources.tables.open_readings import open_readings
from neurosnap.sources.tables.readings import Readings, spans_of


def test_spans_begin_with_a_reading_and_end_with_one() -> None:
    columns = Columns.of([[0, 1], [1, 1], [1, np.nan], [0, 1]], ["a", "b"])
    times = [
        "2024-01-01 00:00:00Z",
        "2024-01-01T01:00:00+01:00",
        "1704067260",
        "1704067320",
    ]
    a, b = spans_of(Readings(columns, times))
    assert a.tolist() == [[1704067200.0, 1704067320.0]]
    # Unknown is not on; what is on at the end was on until then.
    assert b.tolist() == [[1704067200.0, 1704067260.0], [1704067320.0, 1704067320.0]]


def test_a_homes_intervals_come_back(tmp_path: Path) -> None:
    path = tmp_path / "one.sensors"
    path.write_text("1600000000 30 7\n1600000010 5 8\n1600000100 0 8\n")
    seven, eight = spans_of(open_readings(str(path)))
    assert seven.tolist() == [[1600000000, 1600000030]]
    assert eight.tolist() == [[1600000010, 1600000015], [1600000100, 1600000100]]


def test_readings_without_times_or_out_of_order_are_refused() -> None:
    columns = Columns.of([[0], [1]], ["a"])
    with pytest.raises(InvalidValueError, match=r"^data: must say when"):
        spans_of(Readings(columns))
    with pytest.raises(InvalidValueError, match=r"^time: must not be before"):
        spans_of(Readings(columns, ["20", "10"]))
    with pytest.raises(InvalidValueError, match=r"^time: must be a date and a time"):
        spans_of(Readings(columns, ["noon", "10"]))
