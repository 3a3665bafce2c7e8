"""Faults are injected at the stated places, and scores count the flagged sensors."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.sensorium import complete
from tools.paper import fig6_anomalies
from tools.paper.fault_detection import (
    ALARM,
    AMONG,
    FAULTY,
    RIGHT,
    SHOWN,
    VISIBLE,
    DetectionEntry,
)
from tools.paper.fig6_anomalies import scored
from tools.paper.figure import FigureOptions
from tools.paper.sensor_faults import FAULTS, PLACES, Episode, course, faults, seen

pytestmark = pytest.mark.slow

CELL = DetectionEntry(
    place="path",
    threshold=0.01,
    decay=None,
    fault="flipped",
    runs=2,
    steps=800,
    seed=3,
)


@pytest.mark.parametrize("place", PLACES)
def test_a_course_is_what_the_world_shows_of_some_walk(place: str) -> None:
    walk = course(place, 7, 1, 60)
    assert (course(place, 7, 1, 60).bits == walk.bits).all()
    name, target = PLACES[place]
    arguments: dict[str, Any] = {"target": target} if target else {}
    env: gymnasium.Env[Any, Any] = gymnasium.make(name, **arguments)
    number = list(PLACES).index(place)
    of_world, of_moves = np.random.SeedSequence(7, spawn_key=(number, 1, 2)).spawn(2)
    reading, _ = env.reset(seed=int(of_world.generate_state(1)[0]))
    count = len(env.get_wrapper_attr("moves"))
    shown = [reading]
    for action in np.random.default_rng(of_moves).integers(count, size=59).tolist():
        shown.append(env.step(action)[0])
    env.close()
    assert (np.array(shown) == walk.bits).all()


@pytest.mark.parametrize("place", PLACES)
def test_no_walk_contradicts_the_truth_and_there_is_some(place: str) -> None:
    walk = course(place, 0, 0, 400)
    assert all(walk.truth.is_coherent(complete(bits)) for bits in walk.bits)
    assert len(walk.truth.wire_list()) > 0


@pytest.mark.parametrize("fault", FAULTS)
def test_episodes_are_in_the_second_half_one_a_spell(fault: Any) -> None:
    episodes = faults(fault, 5, 1600, 11)
    assert len(episodes) == (0 if fault == "none" else 8)
    for number, episode in enumerate(episodes):
        assert 800 + 100 * number <= episode.first < episode.end <= 900 + 100 * number
        assert episode.end - episode.first in (1, 2, 20)
        assert len(set(episode.sensors)) == (2 if fault == "swapped" else 1)
    assert faults(fault, 5, 15, 0) == []


def test_faults_change_what_they_are_of_and_nothing_else() -> None:
    bits = np.random.default_rng(0).random((10, 4)) < 0.5
    pair, one = [Episode(2, 6, (3, 1))], [Episode(2, 6, (3,))]
    read = {f: seen(bits, f, pair if f == "swapped" else one) for f in FAULTS}
    for fault, found in read.items():
        untouched = [0, 2] if fault == "swapped" else [0, 1, 2]
        assert (found[:, untouched] == bits[:, untouched]).all()
        assert (found[:2] == bits[:2]).all()
        assert (found[6:] == bits[6:]).all()
    assert (read["none"] == bits).all()
    assert not read["stuck off"][2:6, 3].any()
    assert read["stuck on"][2:6, 3].all()
    assert (read["flipped"][2:6, 3] != bits[2:6, 3]).all()
    assert (read["swapped"][2:6, [1, 3]] == bits[2:6, [3, 1]]).all()


def test_flags_are_those_of_a_learner_followed_step_by_step() -> None:
    flags = CELL.row(1)
    walk = course("path", CELL.seed, 1, CELL.steps)
    key = np.random.SeedSequence(CELL.seed, spawn_key=(0, 1, 3)).generate_state(1)
    episodes = faults("flipped", 20, CELL.steps, int(key[0]))
    read = seen(walk.bits, "flipped", episodes)
    snapshot, watcher = (
        EmpiricalSnapshot(20, CELL.threshold),
        AnomalyDetector(20),
    )
    faulty = {t for each in episodes for t in range(each.first, each.end)}
    for step, bits in enumerate(read):
        wrong = bool((bits != walk.bits[step]).any())
        assert bool(flags[step] & FAULTY) == (step in faulty)
        assert bool(flags[step] & SHOWN) == wrong
        # On a path one is below all thresholds from some number on.
        steps_up = (np.diff(bits.astype(int)) < 0).any()
        assert bool(flags[step] & VISIBLE) == bool(wrong and steps_up)
        coherent = snapshot.poc_graph().is_coherent(complete(bits))
        assert bool(flags[step] & ALARM) == (not coherent)
        found = watcher.watch(step, snapshot.poc_graph(), bits)
        if found is not None:
            at_fault = set((bits != walk.bits[step]).nonzero()[0].tolist())
            assert bool(flags[step] & RIGHT) == (set(found.culprits) == at_fault)
            among = at_fault <= set(found.candidates)
            assert bool(flags[step] & AMONG) == among
        snapshot.learn(bits)


def test_scores_count_the_flags_of_the_second_half() -> None:
    flags = np.zeros((1, 20), np.uint16)
    flags[0, 2] = ALARM
    flags[0, 11:13] = ALARM
    flags[0, 13:17] = FAULTY
    flags[0, 14:17] |= SHOWN
    flags[0, 15:17] |= VISIBLE | ALARM | AMONG
    flags[0, 16] |= RIGHT
    flags[0, 18] = FAULTY
    before, held, *_ = scored([(CELL, flags)]).to_dict("records")
    expected = {
        "healthy": 7,
        "shown": 3,
        "episodes": 1,
        "visible": 2 / 3,
        "recall": 2 / 3,
        "precision": 0.5,
        "false": 2 / 7,
        "caught": 1,
        "delay": 1,
        "right": 0.5,
        "among": 1,
        "early": 0.1,
    }
    assert {name: before[name] for name in expected} == pytest.approx(expected)
    assert (held["recall"], held["caught"]) == (0, 0)
    assert np.isnan([held["delay"], held["right"]]).all()
    ours = FAULTY | SHOWN | VISIBLE
    moved = flags & ours | (flags & ~np.uint16(ours)) << 3
    _, held, *_ = scored([(CELL, moved)]).to_dict("records")
    assert {name: held[name] for name in expected} == pytest.approx(expected)


def test_a_report_has_every_cell_and_their_sums() -> None:
    options = FigureOptions(runs=1, steps=40)
    made = fig6_anomalies.cells(options)
    rows = [np.zeros((1, 40), np.uint16) for _ in made]
    rows[0][0, 30] = SHOWN | FAULTY | VISIBLE | ALARM
    report = fig6_anomalies.report(options, rows)
    table = list(report.rows)
    assert len(made) == 5 * 4 * 5
    assert len(table) == 2 * (len(made) + 4 * 5 + 4)
    assert all(len(row) == len(report.columns) for row in table)
    (sums,) = [
        row
        for row in table
        if (row[0], row[3], row[4], row[2]) == ("all", "none", "before", "")
        and row[1] == made[0].threshold
    ]
    assert dict(zip(report.columns, sums, strict=True))["recall"] == 1
    assert len({line.count("|") for line in report.lines}) == 1
