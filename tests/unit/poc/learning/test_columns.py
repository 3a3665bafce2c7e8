"""Tables in memory as columns of bits, and invalid tables."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.columns import Columns, GrowingColumns
from neurosnap.sensorium import Sensorium


class Series:
    """A column as pandas and polars have it, as far as it is read."""

    def __init__(self, values: Sequence[object]) -> None:
        self.values = values

    def to_numpy(self) -> Any:
        return np.array(self.values, object)

    def isna(self) -> "Series":
        return Series([value is None for value in self.values])


class Frame:
    def __init__(self, columns: Mapping[str, Sequence[object]]) -> None:
        self.data = columns

    @property
    def columns(self) -> list[str]:
        return list(self.data)

    def __getitem__(self, name: str) -> Series:
        return Series(self.data[name])


def test_a_data_frame_gives_names_and_unknown_readings() -> None:
    frame = Frame({"door": [True, None, False], "motion": [1, 0, float("nan")]})
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
        Frame({"when": moments, "door": doors, "lamp": ["1", None, 0]})
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
        Columns.of(Frame({"door": [1, 0.5]}))
    with pytest.raises(InvalidValueError, match=r"^data: must be made of 0, 1 and unk"):
        Columns.of([["on", "off"]])
    with pytest.raises(ShapeError, match=r"^data: must be \(ticks, sensors\)"):
        Columns.of([0, 1])
    with pytest.raises(ShapeError, match=r"^names: must be 1, one a column"):
        Columns.of(Frame({"door": [1]}), ["a", "b"])
    with pytest.raises(ShapeError, match=r"^rows: must be of 2 sensors"):
        GrowingColumns(Sensorium.of(2)).append(np.array([True]))
