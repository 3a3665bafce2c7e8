"""Columns over time: what they hold, and that thinning them out leaves the extremes."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.viewer.api import COLUMNS, COUNTED
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.time_series import TimeSeries, thinned
from neurosnap.errors import InvalidValueError
from neurosnap.recording.read.recording import Recording
from tests.support.recorded_runs import (
    TICKS,
    csv_run,
    path_run,
    planner_run,
    recorded,
    seeker_run,
    unread_run,
    without_states,
)


def read(log: Path) -> TimeSeries:
    time_series = TimeSeries(RunView(log))
    while time_series.read_on():
        pass
    return time_series


def column(time_series: TimeSeries, name: str) -> list[float | None]:
    found = time_series.series(name, 1, TICKS, 1000)
    assert found.ticks == list(range(1, TICKS + 1))
    assert found.done
    return found.values


def test_a_column_is_what_was_recorded(tmp_path: Path) -> None:
    log = recorded(path_run(), tmp_path / "run.mcap")
    time_series = read(log)
    states = [each.message for each in Recording.open(log).messages(("state",))]
    for name in ("edges", "depth", "height", "pulses"):
        told = [getattr(state, name) for state in states]
        assert column(time_series, name) == told


def test_sensors_are_counted_by_what_the_frames_say(tmp_path: Path) -> None:
    whole = unread_run(tmp_path / "whole.mcap")
    log = without_states(whole, tmp_path / "gaps.mcap", {5, 6})
    view, time_series = RunView(log), read(log)
    found = {name: time_series.series(name, 1, 99, 1000).values for name in COUNTED}
    assert time_series.missing() == [5, 6]
    assert sum(filter(None, found["predicted"])) > 0
    assert sum(filter(None, found["contradicted"])) > 0
    for frame in view.frames(1, 99):
        neither = frame.state.count(None)
        pairs = zip(frame.bits, frame.state, strict=True)
        assert [found[name][frame.tick - 1] for name in COUNTED] == [
            frame.state.count(1),
            sum(bit is None and held is not None for bit, held in pairs),
            len(frame.contradicted),
            neither - len(frame.contradicted),
        ]


def test_the_target_is_reached_where_the_distance_falls_to_zero(tmp_path: Path) -> None:
    time_series = read(recorded(planner_run(), tmp_path / "run.mcap"))
    far = column(time_series, "distance")
    pairs = zip([None, *far], far, strict=False)
    there = [k for k, (was, now) in enumerate(pairs, 1) if now == 0 and was != 0]
    assert time_series.reached() == there
    assert there


def test_err_is_what_a_walk_through_all_pairs_counts(tmp_path: Path) -> None:
    log = recorded(path_run(), tmp_path / "run.mcap")
    run_view, found = RunView(log), column(read(log), "err")
    sensors = len(run_view.options.sensors)
    # Sensor k of a path is on below k + 1.
    fields = [
        [place <= sensor for place in range(sensors + 1)] for sensor in range(sensors)
    ]
    true = [row for on in fields for row in (on, [not bit for bit in on])]
    for tick, value in enumerate(found, start=1):
        edges = run_view.snapshot(tick).poc_graph().edges
        wrong = 0
        for a in range(2 * sensors):
            for b in range(2 * sensors):
                holds = all(y or not x for x, y in zip(true[a], true[b], strict=True))
                wrong += a >> 1 != b >> 1 and bool(edges[a, b]) != holds
        assert value == wrong


@pytest.mark.parametrize("options", [seeker_run(), planner_run()])
def test_distance_falls_to_zero_at_the_target_only(
    tmp_path: Path, options: object
) -> None:
    log = recorded(options, tmp_path / "run.mcap")  # type: ignore[arg-type]
    run_view = RunView(log)
    frames, found = run_view.frames(1, TICKS), column(read(log), "distance")
    stage = run_view.scene.stage
    assert stage is not None
    assert run_view.run(live=False).columns[-2:] == ("err", "distance")
    for frame, value in zip(frames, found, strict=True):
        assert frame.place is not None
        assert (value == 0) == (frame.place == stage.target)
    for before, after in itertools.pairwise(found):
        assert before is not None
        assert after is not None
        assert abs(after - before) <= 1
    moved = [f for f in frames if "better" in run_view.options.sensors and f.bits[-2]]
    assert all(found[f.tick - 1] < found[f.tick - 2] for f in moved)  # type: ignore[operator]


def test_where_the_truth_is_not_known_there_is_no_column_of_it(tmp_path: Path) -> None:
    log = recorded(csv_run(tmp_path / "r.csv"), tmp_path / "run.mcap")
    time_series = read(log)
    assert time_series.columns == COLUMNS
    with pytest.raises(InvalidValueError, match=r"^column: must be one of edges, "):
        time_series.series("err", 1, TICKS, 100)


def test_what_is_not_read_yet_is_said_to_be_so(tmp_path: Path) -> None:
    time_series = TimeSeries(RunView(recorded(path_run(), tmp_path / "run.mcap")))
    first = time_series.series("edges", 1, TICKS, 100)
    assert (first.ticks, first.values, first.done) == ([], [], False)
    assert time_series.read_on()
    assert time_series.series("edges", 5, 9, 100).ticks == [5, 6, 7, 8, 9]
    assert time_series.series("edges", 5, 9, 100).done
    assert not time_series.read_on()


@given(
    st.lists(st.floats(-1e6, 1e6, width=32) | st.just(float("nan")), max_size=300),
    st.integers(4, 60),
)
def test_thinning_keeps_least_and_most_of_every_run(
    values: list[float], points: int
) -> None:
    row = np.array(values, np.float32)
    places = thinned(row, points)
    assert list(places) == sorted(set(places.tolist()))
    assert len(places) <= max(points, 0)
    if len(values) <= points:
        assert places.tolist() == list(range(len(values)))
        return
    known = row[np.isfinite(row)]
    kept = row[places][np.isfinite(row[places])]
    assert known.size == 0 or (kept.min(), kept.max()) == (known.min(), known.max())
