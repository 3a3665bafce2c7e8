"""The raster, against the frames of the same ticks."""

from pathlib import Path

import numpy as np
import pytest

from neurosnap.apps.viewer.conditions import (
    CONTRADICTED,
    NOT_RECORDED,
    OFF,
    OFF_PREDICTED,
    ON,
    ON_PREDICTED,
    UNKNOWN,
)
from neurosnap.apps.viewer.raster import Raster
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError
from tests.support.recorded_runs import torn_run, unread_run, without_states

TICKS, SENSORS = 32, 3
GONE = range(4, 9)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raster")
    whole = unread_run(folder / "whole.mcap")
    return without_states(whole, folder / "gaps.mcap", GONE)


def read(log: Path, room: int = 1 << 20) -> Raster:
    raster = Raster(RunView(log), room)
    while raster.read_on():
        pass
    return raster


def expected(log: Path) -> dict[tuple[int, int], int]:
    values = {}
    for frame in RunView(log).frames(1, 99):
        for sensor in range(len(frame.bits)):
            read, held = frame.bits[sensor] is not None, frame.state[sensor]
            if held is None:
                torn = sensor in frame.contradicted
                value = CONTRADICTED if torn else UNKNOWN
            elif held:
                value = ON if read else ON_PREDICTED
            else:
                value = OFF if read else OFF_PREDICTED
            values[frame.tick, sensor] = value
    return values


def test_each_value_says_what_its_frame_does(log: Path) -> None:
    found = read(log).part(1, TICKS, 100, 0, 10)
    assert (found.first, found.step, found.columns) == (1, 1, TICKS)
    assert (found.sensors, found.read_to, found.done) == (SENSORS, TICKS, True)
    known = expected(log)
    values = np.frombuffer(found.values, np.uint8).reshape(TICKS, SENSORS)
    for tick in range(1, TICKS + 1):
        for sensor in range(SENSORS):
            told = values[tick - 1, sensor]
            assert told == known.get((tick, sensor), NOT_RECORDED)
    assert {ON, OFF, ON_PREDICTED, UNKNOWN, NOT_RECORDED} <= set(
        values.ravel().tolist()
    )


def test_what_others_say_twice_of_an_unread_sensor_is_contradicted(
    tmp_path: Path,
) -> None:
    log = torn_run(tmp_path / "torn.mcap")
    last = RunView(log).last
    found = read(log).part(1, last, 100, 0, SENSORS)
    values = np.frombuffer(found.values, np.uint8).reshape(last, SENSORS)
    told = {
        (tick + 1, sensor): value for (tick, sensor), value in np.ndenumerate(values)
    }
    assert told == expected(log)
    (frame,) = RunView(log).frames(last, last)
    assert frame.bits[1] is None
    assert told[last, 1] == CONTRADICTED
    assert told[last - 1, 1] == ON_PREDICTED


@pytest.mark.parametrize(
    ("first", "last", "columns", "step"),
    [(1, 32, 32, 1), (1, 32, 8, 4), (1, 32, 7, 5), (5, 20, 100, 1), (30, 99, 2, 2)],
)
def test_a_part_has_every_so_many_of_the_ticks(
    log: Path, first: int, last: int, columns: int, step: int
) -> None:
    raster = read(log)
    whole = np.frombuffer(raster.part(1, TICKS, 99, 0, 9).values, np.uint8)
    part = raster.part(first, last, columns, 1, 1)
    assert (part.first, part.step) == (first, step)
    rows = whole.reshape(TICKS, SENSORS)[first - 1 : last : step, 1]
    assert part.columns == len(rows) <= columns
    assert part.values == rows.tobytes()


def test_what_there_is_no_room_for_is_thinned_out(log: Path) -> None:
    whole = np.frombuffer(read(log).part(1, TICKS, 99, 0, 9).values, np.uint8)
    thin = read(log, room=10 * SENSORS).part(1, TICKS, 99, 0, 9)
    assert (thin.first, thin.step) == (1, 4)
    assert thin.values == whole.reshape(TICKS, SENSORS)[::4].tobytes()
    later = read(log, room=10 * SENSORS).part(6, TICKS, 99, 0, 9)
    assert (later.first, later.step) == (9, 4)


def test_a_sensor_that_is_not_there_is_refused(log: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"sensor: must be in \[0, 2\], got 3"):
        read(log).part(1, TICKS, 9, 3, 1)
