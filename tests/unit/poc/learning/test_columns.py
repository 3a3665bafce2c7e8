"""Tables in memory as columns of bits, and invalid tables."""

from datetime import UTC, datetime

import numpy as np
import pytest
from pandas import DataFrame  # type: ignore[import-untyped]

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.columns import Columns, GrowingColumns
from neurosnap.sensorium import Sensorium


def test_a_data_frame_gives_names_and_unknown_readings() -> None:
    frame = DataFrame({"door": [True, None, False], "motion": [1, 0, float("nan")]})
    columns = Columns.of(frame)
    assert columns.sensorium.names == ("door", "motion")
    assert columns.reading(0).tolist() == [True, False, False]
    assert columns.known(0).tolist() == [True, False, True]
    assert columns.known(1).tolist() == [True, True, False]
    assert Columns.of(frame, ["a", "b"]).sensorium.names == ("a", "b")


def test_a_data_frame_may_hold_words_and_dates() -> None:
    moments = [datetime(2026, 1, 1, hour, tzinfo=UTC) for hour in range(3)]
    doors = ["on", "Off", "unavailable"]
    columns = Columns.of(
        DataFrame({"when": moments, "door": doors, "lamp": ["1", None, 0]})
    )
    assert columns.sensorium.names == ("door", "lamp")
    assert columns.reading(0).tolist() == columns.reading(1).tolist()
    assert columns.known(0).tolist() == [True, True, False]
    assert columns.known(1).tolist() == [True, False, True]


@pytest.mark.parametrize("data", [[[True, None]], [[1, np.nan]], [[1.0, np.nan]]])
def test_arrays_may_hold_unknown_readings(data: list[list[object]]) -> None:
    bits, known = Columns.of(data).row(0)
    assert bits.tolist() == [True, False]
    assert known.tolist() == [True, False]


def test_what_is_no_reading_is_named() -> None:
    with pytest.raises(InvalidValueError, match=r"^1, row 2: must be 0, 1 or unknown"):
        Columns.of([[0, 1], [1, 1], [0, 2]])
    with pytest.raises(InvalidValueError, match=r"^door, row 1: must be 0, 1 or unkn"):
        Columns.of(DataFrame({"door": [1, 0.5]}))
    with pytest.raises(InvalidValueError, match=r"^data: must be made of 0, 1 and unk"):
        Columns.of([["on", "off"]])
    with pytest.raises(ShapeError, match=r"^data: must be \(ticks, sensors\)"):
        Columns.of([0, 1])
    with pytest.raises(ShapeError, match=r"^names: must be 1, one a column"):
        Columns.of(DataFrame({"door": [1]}), ["a", "b"])
    with pytest.raises(ShapeError, match=r"^rows: must be of 2 sensors"):
        GrowingColumns(Sensorium.of(2)).append(np.array([True]))
