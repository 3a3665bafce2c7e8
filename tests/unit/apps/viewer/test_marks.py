"""The marks of a run are what its messages say, however they lie in its chunks."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from neurosnap import wire
from neurosnap.apps.viewer.api import RaisedAlarm
from neurosnap.apps.viewer.marks import Found, RunMarks
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.order.literals import from_words
from neurosnap.protocol.anomaly_messages import told, with_support
from neurosnap.protocol.anomaly_text import evidence
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.replay import Replay
from tests.support.lamp import LIMITED, lamp_options
from tests.support.recorded_runs import csv_run, in_chunks, recorded

TICKS = 60
SUPPORT = 2


@pytest.fixture(scope="module", params=["cells", "workers"])
def log(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return a recording in which a rule is broken, once after it was well tested."""
    folder = tmp_path_factory.mktemp("marks")
    options = csv_run(folder / "rows.csv", TICKS)
    workers = int(request.param == "workers")
    options = replace(options, watch=True, support=SUPPORT, workers=workers)
    return recorded(options, folder / "run.mcap")


def read(path: Path) -> RunMarks:
    marks = RunMarks(RunView(path))
    while marks.read_on():
        pass
    return marks


def anomalies(path: Path) -> dict[int, wire.Anomaly]:
    """Return those that are told, by tick."""
    found = {}
    for each in Recording.open(path).messages(("anomaly",)):
        assert isinstance(each.message, wire.Anomaly)
        if (rest := with_support(each.message, SUPPORT)) is not None:
            found[rest.tick] = rest
    return found


def rewired(path: Path) -> list[int]:
    """Return how many edges each tick changed, by the orders of a replay."""
    replay, found, before = Replay(Recording.open(path)), [], None
    for _ in replay.ticks():
        graph = replay.core.graph
        edges = from_words(graph.wires("hasse"), len(graph.edges))
        before = np.zeros_like(edges) if before is None else before
        found.append((int((edges != before).sum()) + 1) // 2)
        before = edges
    return found


def test_a_stretch_a_tick_has_what_the_messages_say(log: Path) -> None:
    marks = read(log).marks(1, TICKS, 1000)
    ticks = range(1, TICKS + 1)
    assert (marks.first, marks.last, marks.read_to, marks.done) == (
        1,
        TICKS,
        TICKS,
        True,
    )
    assert [tick for tick in ticks if marks.anomalies[tick - 1]] == [*anomalies(log)]
    assert set(marks.anomalies) == {0, 1}
    changed = rewired(log)
    assert marks.rewired[1:] == changed[1:]  # the first tick wires everything whole
    assert sum(changed[1:]) > 0
    sent = [each.sent for each in Recording.open(log).messages(("observe",))]
    assert marks.times == [pytest.approx(each / 1e9) for each in sent]
    assert marks.begins == [1, *[0] * (TICKS - 1)]


@pytest.mark.parametrize("seed", range(4))
def test_chunks_of_any_size_make_the_same_marks(
    log: Path, tmp_path: Path, seed: int
) -> None:
    expected = read(log).marks(1, TICKS, 1000)
    split = in_chunks(log, tmp_path / "split.mcap", 1 + 700 * seed, seed)
    assert read(split).marks(1, TICKS, 1000) == expected


@pytest.mark.parametrize("bins", [1, 2, 7, 59])
def test_fewer_stretches_add_up(log: Path, bins: int) -> None:
    marks, each = read(log), read(log).marks(1, TICKS, TICKS)
    few = marks.marks(1, TICKS, bins)
    assert len(few.anomalies) == len(few.rewired) == len(few.times) == bins
    assert sum(few.anomalies) == sum(each.anomalies)
    assert sum(few.begins) == sum(each.begins)
    assert max(few.rewired) == max(each.rewired)
    part = marks.marks(11, 20, 10)
    assert part.anomalies == each.anomalies[10:20]
    assert part.rewired == each.rewired[10:20]


def test_the_anomaly_beside_a_tick_is_the_nearest(log: Path) -> None:
    marks, ticks = read(log), sorted(anomalies(log))
    assert ticks
    for tick in range(TICKS + 2):
        after = [one for one in ticks if one > tick]
        before = [one for one in ticks if one < tick]
        assert marks.beside(tick, 1).tick == min(after, default=None)
        assert marks.beside(tick, -1).tick == max(before, default=None)


def test_what_others_found_is_counted_and_gone_to(log: Path) -> None:
    marks, told = read(log), sorted(anomalies(log))
    alarms = [RaisedAlarm(tick, 0, f"alarm {tick}") for tick in (3, 3, 17, 60)]
    found = Found(alarms, reached=[4, 60], born=[9, 9], missing=[1, 2, 30], done=False)
    each = marks.marks(1, TICKS, TICKS, found)
    ticks = range(1, TICKS + 1)
    assert [tick for tick in ticks if each.reached[tick - 1]] == [4, 60]
    assert each.born == [2 if tick == 9 else 0 for tick in ticks]
    assert [tick for tick in ticks if each.missing[tick - 1]] == [1, 2, 30]
    assert each.alarms == alarms
    assert marks.marks(4, 59, 7, found).alarms == alarms[2:3]
    assert not each.done
    both = sorted({*told, 3, 17, 60})
    for tick in range(TICKS + 2):
        after = [one for one in both if one > tick]
        before = [one for one in both if one < tick]
        assert marks.beside(tick, 1, found).tick == min(after, default=None)
        assert marks.beside(tick, -1, found).tick == max(before, default=None)


def test_a_frame_tells_its_anomaly_as_watch_does(log: Path) -> None:
    view, found = RunView(log), anomalies(log)
    for frame in view.frames(1, TICKS):
        if frame.tick not in found:
            assert frame.anomaly is None
            continue
        assert frame.anomaly is not None
        anomaly = found[frame.tick]
        words = told(anomaly, view.options.sensors)
        said = [one.evidence for one in frame.anomaly.broken]
        assert said == [evidence(link) for link in words.broken]
        assert frame.anomaly.culprits == list(anomaly.culprits)
        both = {*frame.anomaly.culprits, *frame.anomaly.others}
        assert both == {*anomaly.culprits, *anomaly.candidates}
        pairs = [(one.source, one.target) for one in frame.anomaly.broken]
        assert pairs == [*zip(anomaly.sources, anomaly.targets, strict=True)]


def test_beginnings_of_trajectories_are_marked(tmp_path: Path) -> None:
    options = lamp_options(LIMITED, ticks=40, cells="inline")
    log = recorded(options, tmp_path / "run.mcap")
    begins = [
        each.message.tick
        for each in Recording.open(log).messages(("observe",))
        if isinstance(each.message, wire.Observation) and each.message.begins
    ]
    marks = read(log).marks(1, 40, 40)
    assert [tick for tick in range(1, 41) if marks.begins[tick - 1]] == begins
    assert len(begins) > 1
