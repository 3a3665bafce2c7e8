"""Playback shows the replayed state at every tick, after any seek."""

import random
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import complete, unpack
from neurosnap.sources.protocol import Observed
from tests.support.exhaustive import rows
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    recorded_run,
    scripted_options,
)
from tests.support.recorded_messages import of_type
from tests.support.recorded_runs import (
    TICKS,
    Told,
    csv_run,
    in_chunks,
    path_run,
    planner_run,
    recorded,
    told,
)
from tests.support.rewritten_recordings import spoil
from tests.support.run_options import options_for
from tests.support.scripted_sources import Scripted

pytestmark = pytest.mark.slow

RUNS: dict[str, Callable[[Path], RunOptions]] = {
    "derived": lambda folder: path_run(wiring="derived"),
    "planner": lambda folder: planner_run(),
    "csv": lambda folder: csv_run(folder / "readings.csv"),
}


@pytest.fixture(scope="module", params=RUNS)
def log(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    return recorded(RUNS[request.param](folder), folder / "run.mcap")


@pytest.fixture(scope="module")
def derived(log: Path) -> dict[int, Told]:
    return told(log)


@pytest.fixture(scope="module")
def small(log: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The same in some fifty chunks."""
    folder = tmp_path_factory.mktemp("small")
    chunk = log.stat().st_size // 25
    return in_chunks(log, folder / "small.mcap", chunk).read_bytes()


@pytest.fixture(scope="module")
def path_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


class Late(Scripted):
    """One of which each tick from the third on is late."""

    def _show(self, *, begins: bool = False, cut: bool = False) -> Observed | None:
        seen = super()._show(begins=begins, cut=cut)
        if seen is None or self._next < 3:
            return seen
        return msgspec.structs.replace(seen, due=float(self._next), waiting=9)


def test_a_tick_that_is_behind_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Late(implying_rows(5, 1), ACTIONS)
    opens = "neurosnap.runtime.parts.world_process.open_source"
    monkeypatch.setattr(opens, lambda *_: source)
    behind = recorded_run(scripted_options(5), tmp_path / "log").behind
    assert behind is not None
    assert (behind.tick, behind.waiting) == (3, 9)
    assert behind.seconds > 1e9  # since 1970
    said = [frame.intake for frame in RunView(tmp_path / "log").frames(1, 5)]
    assert [len(lines) for lines in said] == [0, 0, 1, 1, 0]  # the last has no decision
    assert " s behind, 9 ticks wait; the " in said[2][0]


def edges_of(graph: api.Graph) -> frozenset[tuple[int, int]]:
    """Return the Hasse wiring that a drawn order stands for."""
    edges = set()
    for edge in graph.edges:
        edges |= {(edge.source, edge.target), (edge.target ^ 1, edge.source ^ 1)}
    for first, *others in graph.classes:
        for literal in others:
            pairs = {(first, literal), (literal, first)}
            edges |= pairs | {(a ^ 1, b ^ 1) for a, b in pairs}
    return frozenset(edges)


@pytest.mark.parametrize("chunks", rows([20], [1]))
def test_every_tick_is_what_a_replay_derives(
    log: Path, derived: dict[int, Told], tmp_path: Path, chunks: int
) -> None:
    chunk = log.stat().st_size // chunks
    again = in_chunks(log, tmp_path / "again.mcap", chunk, seed=chunks)
    run_view = RunView(again)
    assert (run_view.first, run_view.last) == (1, TICKS) == (1, len(derived))
    order = random.Random(2).sample(sorted(derived), len(derived))
    for tick in order:
        (frame,) = run_view.frames(tick, tick)
        graph = run_view.graph(tick)
        assert (frame.tick, graph.tick) == (tick, tick)
        assert frame.state == derived[tick].state
        assert frame.graph == graph.id
        assert edges_of(graph) == derived[tick].hasse
        assert graph.height == frame.height == derived[tick].height
    assert run_view.frames(1, TICKS) == [
        run_view.frames(t, t)[0] for t in sorted(derived)
    ]


def test_an_order_keeps_its_id_as_long_as_it_is_the_same(
    log: Path, derived: dict[int, Told]
) -> None:
    run_view = RunView(log)
    for before, after in zip(range(1, TICKS), range(2, TICKS + 1), strict=True):
        same = derived[before].hasse == derived[after].hasse
        assert (run_view.graph(before).id == run_view.graph(after).id) == same


def test_a_frame_says_what_was_recorded_of_its_tick(log: Path) -> None:
    run_view = RunView(log)
    frames = {frame.tick: frame for frame in run_view.frames(1, TICKS)}
    for state in of_type(log, wire.State):
        frame = frames[state.tick]
        for name in ("incoherent", "depth", "longest", "height", "edges", "pulses"):
            assert getattr(frame, name) == getattr(state, name)
        assert bool(frame.contradicted) == state.incoherent
    for observation in of_type(log, wire.Observation):
        bits = unpack(observation.bits, len(run_view.options.sensors))
        assert frames[observation.tick].bits == bits.tolist()
    actions = (*run_view.options.body.actions, None)
    for decision in of_type(log, wire.Decision):
        if decision.tick:
            frame = frames[decision.tick]
            assert (frame.choice, frame.why) == (decision.action, decision.why)
            assert frame.action == actions[decision.action]


def test_waves_reach_what_is_above_their_signals(log: Path, tmp_path: Path) -> None:
    chunk = log.stat().st_size // 20
    run_view = RunView(in_chunks(log, tmp_path / "again.mcap", chunk, seed=8))
    answers = {
        message.wave: unpack(message.literals, 2 * len(run_view.options.sensors))
        for message in of_type(log, wire.Reached)
    }
    reported = {
        (message.wave, literal): hops
        for message in of_type(log, wire.CellReport)
        for literal, hops in zip(message.literals, message.hops, strict=True)
    }
    for frame in run_view.frames(1, TICKS):
        graph = run_view.learned(frame.tick).snapshot.poc_graph()
        kinds = [wave.kind for wave in frame.waves]
        assert kinds == ["state"] + ["signal"] * (len(kinds) - 1)
        for shown in frame.waves:
            wave = run_view.wave(frame.tick, shown.wave)
            assert shown.hops == (None if wave.imagined else wave.hops)
            assert wave.settled
            assert wave.hops is not None
            above = np.flatnonzero(graph.up(wave.signal)).tolist()
            assert sorted(literal for literal, _ in wave.hops) == above
            assert wave.depth == max(hops for _, hops in wave.hops)
            assert all(reported[wave.wave, a] == hops for a, hops in wave.hops)
            if wave.wave in answers:
                assert above == np.flatnonzero(answers.pop(wave.wave)).tolist()
        observed = np.flatnonzero(complete(np.array(frame.bits, np.bool_))).tolist()
        assert frame.waves[0].signal == observed
        assert (frame.waves[0].depth, frame.waves[0].pulses) == (
            frame.depth,
            frame.pulses,
        )
    assert not answers


def test_weights_are_those_of_the_snapshot(path_log: Path) -> None:
    run_view = RunView(path_log)
    counts = dict.fromkeys([(1, 1), (1, 0), (0, 1), (0, 0)], 0)
    for observation in of_type(path_log, wire.Observation):
        bits = unpack(observation.bits, len(run_view.options.sensors))
        counts[int(bits[0]), int(bits[2])] += 1
        tick = observation.tick
        found = run_view.edge(0, 4, tick)
        assert (found.tick, found.weights) == (tick, tuple(counts.values()))
        assert found.threshold == pytest.approx(0.08 * tick)
        graph = run_view.learned(tick).snapshot.poc_graph()
        assert found.holds == bool(graph.edges[0, 4])


def test_before_the_first_tick_nothing_is_learned_and_beyond_the_ends_is_nothing(
    path_log: Path,
) -> None:
    graph = RunView(path_log).graph(0)
    assert (graph.edges, graph.classes, graph.height) == ([], [], 0)
    assert graph.id != RunView(path_log).graph(TICKS).id
    nothing = PocGraph.from_implications(len(graph.nodes), [])
    assert [node.group for node in graph.nodes] == nothing.representative[::2].tolist()
    run_view = RunView(path_log)
    for tick in (-1, TICKS + 1):
        with pytest.raises(
            InvalidValueError, match=rf"^tick: must be in \[0, {TICKS}\]"
        ):
            run_view.graph(tick)
    ends = {(0, 2): [1, 2], (TICKS, TICKS + 9): [TICKS], (TICKS + 1, TICKS + 2): []}
    for asked, there in ends.items():
        assert [frame.tick for frame in run_view.frames(*asked)] == there


# What is broken -----------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.3, 0.55, 0.8, 0.99])
def test_a_recording_cut_short_shows_what_is_left(
    derived: dict[int, Told], small: bytes, tmp_path: Path, share: float
) -> None:
    log = tmp_path / "cut.mcap"
    log.write_bytes(small[: int(share * len(small))])
    run_view = RunView(log)
    assert "cut short after" in (run_view.cut(live=False) or "")
    assert run_view.cut(live=True) is None
    states = [state.tick for state in of_type(log, wire.State)]
    assert run_view.last == max(states, default=0)
    for frame in run_view.frames(1, run_view.last):
        assert frame.state == derived[frame.tick].state
        assert edges_of(run_view.graph(frame.tick)) == derived[frame.tick].hasse


def test_behind_a_damaged_chunk_a_key_frame_helps(
    path_log: Path, tmp_path: Path
) -> None:
    derived = told(path_log)
    small = in_chunks(path_log, tmp_path / "small.mcap", 4000)
    hurt = spoil(small, 17)  # between two key-frames
    lacking = {*derived} - {one.tick for one in of_type(small, wire.Observation)}
    run_view = RunView(small)
    frames = {frame.tick: frame for frame in run_view.frames(1, TICKS)}
    assert f"chunk {hurt.number}" in (run_view.cut(live=False) or "")
    assert 0 < len(frames) < TICKS
    assert all(frame.state == derived[tick].state for tick, frame in frames.items())
    for tick in range(1, TICKS + 1):
        since = range(tick - tick % 7 + 1, tick + 1)  # the last key-frame
        if lacking.isdisjoint(since):
            assert edges_of(run_view.graph(tick)) == derived[tick].hasse
        else:
            with pytest.raises(RecordingError, match="must hold the observation of"):
                run_view.graph(tick)
        if tick in frames:
            assert bool(frames[tick].graph) == lacking.isdisjoint(since)


def test_a_growing_recording_is_followed(small: bytes, tmp_path: Path) -> None:
    data, growing = small, tmp_path / "growing.mcap"
    growing.write_bytes(data[: len(data) // 4])
    run_view, seen = RunView(growing), set()
    for share in range(25, 100, 9):
        with growing.open("r+b") as file:
            file.write(data[: max(len(data) * share // 100, 100)])
        run_view.grow()
        seen.add(run_view.last)
        fresh, last = RunView(growing), run_view.last
        assert fresh.last == last
        if last:
            assert run_view.frames(last, last) == fresh.frames(last, last)
    growing.write_bytes(data)
    assert run_view.grow()
    assert not run_view.grow()
    assert len(seen) > 3
    assert (run_view.last, run_view.cut(live=False)) == (TICKS, None)
    assert run_view.recording.cut is None
    assert run_view.frames(1, TICKS) == RunView(growing).frames(1, TICKS)


# The images of an environment ---------------------------------------------------------

EVERY = 6


def due(tick: int) -> int:
    return tick - (tick - 1) % EVERY


def test_every_frame_names_its_image_while_the_recording_grows(tmp_path: Path) -> None:
    options = options_for(
        "neurosnap/FrozenLake-v0", 5, ticks=TICKS, cells="inline", frames=EVERY
    )
    whole = recorded(options, tmp_path / "whole.mcap")
    lake_log = in_chunks(whole, tmp_path / "cut.mcap", 9000)
    data = lake_log.read_bytes()
    ends = [
        c.offset + c.packed for c in Recording.open(lake_log).files[0].layout.chunks
    ]
    assert len(ends) > 5
    growing = tmp_path / "run.mcap"
    growing.write_bytes(data[: ends[0]])
    run_view = RunView(growing)
    for end in ends[1:]:
        growing.write_bytes(data[:end])
        run_view.grow()
        # That of the last tick is sent behind its observation, and may be to come.
        known = run_view.frames(1, run_view.last - 1)
        assert [frame.image for frame in known] == [due(f.tick) for f in known]
    assert run_view.last > TICKS // 2
    (last,) = RunView(lake_log).frames(TICKS, TICKS)
    assert last.image == due(TICKS)
