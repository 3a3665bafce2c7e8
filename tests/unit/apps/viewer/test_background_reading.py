"""Background reading of a run matches its messages and key-frames."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.viewer import background_reading, time_series
from neurosnap.apps.viewer.api import COUNTED, Finding, ReadSoFar
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import (
    CONTRADICTED,
    NOT_RECORDED,
    OFF,
    OFF_PREDICTED,
    ON,
    ON_PREDICTED,
    UNKNOWN,
)
from neurosnap.apps.viewer.time_series import thinned
from neurosnap.depth.measure import from_recording
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.protocol.anomaly_report import named_anomaly, with_support
from neurosnap.recording.read.recorded_readings import readings_of
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.grown_sensors import RecordedBirth
from tests.support.lamp import LIMITED, lamp_options
from tests.support.page_requests import read
from tests.support.recorded_messages import of_type
from tests.support.recorded_runs import TICKS as FEW
from tests.support.recorded_runs import (
    csv_run,
    in_chunks,
    path_run,
    planner_run,
    recorded,
    scripted_run,
    torn_run,
    unread_run,
    without_states,
)

TICKS, SUPPORT, SENSORS = 60, 2, 3
GONE = range(4, 9)
LAST = 32  # the last tick of the run that leaves sensors unread


def column(history: RunHistory, name: str, last: int = FEW) -> list[float | None]:
    found = history.series(1, last, 1000)
    assert found.done
    curve = found.columns[name]  # type: ignore[index]
    assert curve.ticks == list(range(1, last + 1))
    return curve.values


ASKED: dict[str, Callable[[RunHistory], object]] = {
    "curves": lambda history: history.series(1, TICKS, 1000),
    "marks": lambda history: history.marks(1, TICKS, 1000),
    "raster": lambda history: history.raster(1, TICKS, TICKS, 0, SENSORS),
    "grown": lambda history: history.grown(),
}


@pytest.mark.parametrize("ask", ASKED.values(), ids=ASKED)
def test_an_answer_that_is_whole_lacks_nothing_that_is_read_meanwhile(
    ask: Callable[[RunHistory], object], log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    history, whole = RunHistory(RunView(log)), read(log)
    so_far = history._so_far

    def so_far_in_the_end(last: int) -> ReadSoFar:
        while history.read_on():
            pass
        return so_far(last)

    monkeypatch.setattr(history, "_so_far", so_far_in_the_end)
    assert ask(history) == ask(whole)


@pytest.fixture(scope="module")
def planner_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(planner_run(), tmp_path_factory.mktemp("planner") / "run.mcap")


@pytest.mark.parametrize("most", [2000, 3])
def test_every_wave_is_counted_once_by_height_and_depth(
    most: int, planner_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background_reading, "_MOST_PLACES", most)
    rows = from_recording(Recording.open(planner_log))
    depths = read(planner_log).depths()
    assert depths.done
    assert sum(each.count for each in depths.counts) + depths.left_out == len(rows)
    pairs = Counter((row.kind, row.height, row.depth) for row in rows)
    view = RunView(planner_log)
    for one in depths.counts:
        assert one.count == pairs[one.kind, one.height, one.depth]
        (frame,) = view.frames(one.tick, one.tick)
        (wave,) = [wave for wave in frame.waves if wave.wave == one.wave]
        assert (wave.kind, wave.depth) == (one.kind, one.depth)
    assert len(depths.counts) == min(most, len(pairs))
    assert (depths.left_out > 0) == (most < len(pairs))


# How often relations were tested ------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("most", [150, 500])
def test_relations_are_tested_on_as_many_occasions_as_readings_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr(time_series, "_BLOCK", 64)  # it has to grow
    recording = Recording.open(recorded(path_run(200), tmp_path / "run.mcap"))
    view, sensors = RunView(recording.path), recording.options.body.count
    monkeypatch.setattr(time_series, "_MOST_READINGS", most * sensors)
    history = read(recording.path)
    for tick in (1, 63, 64, 128, 200):
        graph, sensorium = view.graph(tick), view.learned(tick).snapshot.sensorium
        columns = readings_of(recording, sensorium, min(tick, most)).columns
        occasions = count_pairs(columns).occasions

        def held(a: int, b: int, occasions: NDArray[np.uint32] = occasions) -> int:
            a, b = max(a, b), min(a, b)
            pair = (a >> 1) * ((a >> 1) - 1) // 2 + (b >> 1)
            joint = 2 * (a & 1) + (b & 1)
            return int(min(occasions[joint, pair], occasions[3 - joint, pair]))

        told = history.tested(tick, graph)
        assert told.done
        assert 0 not in told.edges  # the rule tests both sides
        assert told.edges == [held(e.source, e.target) for e in graph.edges]
        same = dict(zip((node.sensor for node in graph.nodes), told.nodes, strict=True))
        for first, *others in graph.classes:
            assert [same.pop(one >> 1) for one in others] == [
                held(first, one) for one in others
            ]
            assert same.pop(first >> 1) == max(held(first, one) for one in others)
        assert not any(same.values())


def test_copies_are_tested_as_often_as_they_changed(tmp_path: Path) -> None:
    rows: list[list[bool | None]] = [
        [n % 2 == 0, n % 2 == 0, n % 2 > 0] for n in range(20)
    ]
    log = scripted_run(rows, tmp_path / "copies.mcap")
    graph = RunView(log).graph(20)
    assert graph.classes == [(0, 2, 5)]
    assert read(log).tested(20, graph).nodes == [10, 10, 10]


# Marks ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which a rule is broken, once after it was well tested."""
    folder = tmp_path_factory.mktemp("marks")
    options = csv_run(folder / "rows.csv", TICKS)
    options = replace(options, watch=True, support=SUPPORT)
    return recorded(options, folder / "run.mcap")


def anomalies(path: Path) -> dict[int, wire.Anomaly]:
    """Return those that are told, by tick."""
    every = (with_support(each, SUPPORT) for each in of_type(path, wire.Anomaly))
    return {rest.tick: rest for rest in every if rest is not None}


def test_a_stretch_a_tick_has_what_the_messages_say(log: Path) -> None:
    marks = read(log).marks(1, TICKS, 1000)
    ticks = range(1, TICKS + 1)
    assert (marks.first, marks.last, marks.read_to) == (1, TICKS, TICKS)
    assert marks.done
    assert [tick for tick in ticks if marks.anomalies[tick - 1]] == [*anomalies(log)]
    assert set(marks.anomalies) == {0, 1}
    assert marks.times == [None] * TICKS  # the file has none
    assert marks.begins == [1, *[0] * (TICKS - 1)]


def test_chunks_of_any_size_make_the_same_marks(log: Path, tmp_path: Path) -> None:
    expected = read(log).marks(1, TICKS, 1000)
    for seed in (0, 3):
        split = in_chunks(log, tmp_path / f"{seed}.mcap", 700 + 700 * seed, seed)
        assert read(split).marks(1, TICKS, 1000) == expected


def test_fewer_stretches_add_up(log: Path) -> None:
    marks = read(log)
    each = marks.marks(1, TICKS, TICKS)
    for bins in (1, 2, 7, 59):
        few = marks.marks(1, TICKS, bins)
        assert len(few.anomalies) == len(few.times) == bins
        assert sum(few.anomalies) == sum(each.anomalies)
        assert sum(few.begins) == sum(each.begins)
    part = marks.marks(11, 20, 10)
    assert part.anomalies == each.anomalies[10:20]


def test_what_else_was_found_is_counted_and_gone_to(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marks, told = read(log), sorted(anomalies(log))
    alarms = [3, 3, 17, 60]
    raised = [
        Finding(sensors=[0], tick=at, first=at, last=at, what="", sentence="")
        for at in alarms
    ]
    monkeypatch.setattr(marks._findings, "alarms", raised)
    birth = RecordedBirth(tick=9, sensor=3, name="a", history=None)
    monkeypatch.setattr(marks._series.births, "listed", (birth, birth))
    monkeypatch.setattr(marks._series, "missing", lambda: [1, 2, 30])
    each = marks.marks(1, TICKS, TICKS)
    ticks = range(1, TICKS + 1)
    assert each.born == [2 if tick == 9 else 0 for tick in ticks]
    assert [tick for tick in ticks if each.missing[tick - 1]] == [1, 2, 30]
    assert each.alarms == [alarms.count(tick) for tick in ticks]
    assert sum(marks.marks(4, 59, 7).alarms) == 1
    both = sorted({*told, 3, 17, 60})
    for tick in range(TICKS + 2):
        after = [one for one in both if one > tick]
        before = [one for one in both if one < tick]
        assert marks.beside(tick).on == min(after, default=None)
        assert marks.beside(tick).back == max(before, default=None)
    # Every tick is an hour; ten of them are not there.
    times = {tick: 3600.0 * tick for tick in range(1, 400) if not 70 < tick < 81}
    monkeypatch.setattr(marks._findings, "times", times)
    days = [(24, None), (25, 1), (75, None), (100, 70), (399, 375)]
    assert [(tick, marks.beside(tick).day) for tick, _ in days] == days
    assert [marks.beside(tick).week for tick in (168, 169, 399)] == [None, 1, 231]


def test_a_frame_tells_its_anomaly_as_watch_does(log: Path) -> None:
    view, found = RunView(log), anomalies(log)
    for frame in view.frames(1, TICKS):
        if frame.tick not in found:
            assert frame.anomaly is None
            continue
        assert frame.anomaly is not None
        anomaly = found[frame.tick]
        words = named_anomaly(anomaly, view.options.body)
        assert frame.anomaly.sentence == words.sentence
        assert frame.anomaly.culprits == list(anomaly.culprits)
        both = {*frame.anomaly.culprits, *frame.anomaly.others}
        assert both == {*anomaly.culprits, *anomaly.candidates}
        links = [(one.source, one.target) for one in anomaly.links]
        assert frame.anomaly.rule in links


def test_beginnings_of_trajectories_are_marked(tmp_path: Path) -> None:
    options = lamp_options(LIMITED, ticks=40, cells="inline")
    log = recorded(options, tmp_path / "run.mcap")
    begins = [each.tick for each in of_type(log, wire.Observation) if each.begins]
    marks = read(log).marks(1, 40, 40)
    assert [tick for tick in range(1, 41) if marks.begins[tick - 1]] == begins
    assert len(begins) > 1


# Raster -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gaps_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raster")
    whole = unread_run(folder / "whole.mcap")
    return without_states(whole, folder / "gaps.mcap", GONE)


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


def test_each_value_says_what_its_frame_does(gaps_log: Path) -> None:
    found = read(gaps_log).raster(1, LAST, 100, 0, 10)
    assert (found.first, found.step, found.columns) == (1, 1, LAST)
    assert (found.sensors, found.read_to, found.done) == (SENSORS, LAST, True)
    known = expected(gaps_log)
    values = np.frombuffer(found.values, np.uint8).reshape(LAST, SENSORS)
    for tick in range(1, LAST + 1):
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
    found = read(log).raster(1, last, 100, 0, SENSORS)
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
    gaps_log: Path, first: int, last: int, columns: int, step: int
) -> None:
    history = read(gaps_log)
    whole = np.frombuffer(history.raster(1, LAST, 99, 0, 9).values, np.uint8)
    part = history.raster(first, last, columns, 1, 1)
    assert (part.first, part.step) == (first, step)
    rows = whole.reshape(LAST, SENSORS)[first - 1 : last : step, 1]
    assert part.columns == len(rows) <= columns
    assert part.values == rows.tobytes()


def test_what_there_is_no_room_for_is_thinned_out(
    gaps_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = np.frombuffer(read(gaps_log).raster(1, LAST, 99, 0, 9).values, np.uint8)
    monkeypatch.setattr(time_series, "_RASTER_ROOM", 10 * SENSORS)
    thin = read(gaps_log).raster(1, LAST, 99, 0, 9)
    assert (thin.first, thin.step) == (1, 4)
    assert thin.values == whole.reshape(LAST, SENSORS)[::4].tobytes()
    later = read(gaps_log).raster(6, LAST, 99, 0, 9)
    assert (later.first, later.step) == (9, 4)


def test_a_sensor_that_is_not_there_is_refused(gaps_log: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"sensor: must be in \[0, 2\], got 3"):
        read(gaps_log).raster(1, LAST, 9, 3, 1)


# Columns ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def path_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


def test_a_column_is_what_was_recorded(path_log: Path) -> None:
    history = read(path_log)
    states = of_type(path_log, wire.State)
    for name in ("edges", "depth", "height", "pulses"):
        told = [getattr(state, name) for state in states]
        assert column(history, name) == told


def test_sensors_are_counted_by_what_the_frames_say(tmp_path: Path) -> None:
    whole = unread_run(tmp_path / "whole.mcap")
    log = without_states(whole, tmp_path / "gaps.mcap", {5, 6})
    view, history = RunView(log), read(log)
    found = {name: column(history, name, LAST) for name in COUNTED}
    assert history.marks(1, LAST, LAST).missing[4:6] == [1, 1]
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


@pytest.mark.slow
def test_the_target_is_reached_where_the_agent_comes_to_it(planner_log: Path) -> None:
    run_view = RunView(planner_log)
    stage = run_view.scene.stage
    assert stage is not None
    places = [frame.place for frame in run_view.frames(1, FEW)]
    pairs = zip([None, *places], places, strict=False)
    there = [k for k, (a, b) in enumerate(pairs, 1) if b == stage.target and a != b]
    reached = read(planner_log).marks(1, FEW, FEW).reached
    assert [tick for tick, some in enumerate(reached, 1) if some] == there
    assert there


def test_what_is_not_read_yet_is_said_to_be_so(path_log: Path) -> None:
    history = RunHistory(RunView(path_log))
    first = history.series(1, FEW, 100)
    assert (first.columns["edges"].ticks, first.done) == ([], False)
    assert history.read_on()
    part = history.series(5, 9, 100)
    assert (part.columns["edges"].ticks, part.done) == ([5, 6, 7, 8, 9], True)
    times = read(path_log).marks(1, FEW, 1000).times
    sent = [each.sent for each in Recording.open(path_log).messages(("observation",))]
    assert times == [each / 1e9 for each in sent]


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
