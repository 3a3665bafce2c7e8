"""The compiled errors are those of snapshots observed one by one."""

import gymnasium
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments.learning_error import (
    LearningEntry,
    TruthKind,
    errors,
)
from neurosnap.apps.figures.experiments.walks import SETTINGS, Walk, walks
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from tests.support.figure_entries import ENTRY
from tools.bench.learn import pace

DECAYS = st.none() | st.sampled_from([0.0, 0.5, 0.75, 0.9, 1 - 2**-6])


@st.composite
def wandering(draw: st.DrawFn) -> Walk:
    """A walk on a small cycle with a loop, and fields of any kind."""
    count, places = draw(st.integers(1, 5)), draw(st.integers(1, 9))
    fields = draw(hnp.arrays(np.bool_, (count, places)))
    here = np.arange(places)
    moves = np.stack([(here + 1) % places, (here - 1) % places, here])
    steps = draw(st.lists(st.integers(0, 2), max_size=60))
    trail = [draw(st.integers(0, places - 1))]
    for action in steps:
        trail.append(int(moves[action, trail[-1]]))
    return Walk(fields, moves, np.array(trail))


def true_edges(walk: Walk, learner: LearningEntry) -> set[tuple[int, int]]:
    places = range(walk.fields.shape[1])
    literals = range(2 * len(walk.fields))
    field = [{x for x in places if walk.fields[a // 2, x] != a % 2} for a in literals]
    pairs = [(a, b) for a in literals for b in literals if a // 2 != b // 2]
    if learner.truth == "contained":
        return {(a, b) for a, b in pairs if field[a] <= field[b]}
    # Counted in places, which all are as likely: this walk goes round and both ways.
    limit = learner.threshold * len(places) - 1e-9
    return {
        (a, b)
        for a, b in pairs
        if len(field[a] - field[b])
        < min(
            limit,
            len(field[a] & field[b]),
            len(field[b] - field[a]),
            len(places) - len(field[a] | field[b]),
        )
        or (learner.equivalences and field[a] == field[b])
    }


def one_by_one(walk: Walk, learner: LearningEntry) -> list[int]:
    count = len(walk.fields)
    snapshot = (
        EmpiricalSnapshot(count, learner.threshold)
        if learner.decay is None
        else DiscountedSnapshot(count, learner.threshold, learner.decay)
    )
    true = true_edges(walk, learner)
    found = []
    for place in walk.places:
        snapshot.learn(walk.fields[:, place])
        edges = snapshot.poc_graph(learner.equivalences).edges
        found.append(len({(int(a), int(b)) for a, b in np.argwhere(edges)} ^ true))
    return found


@given(
    wandering(),
    st.sampled_from([1 / 8000, 0.03, 0.1, 0.25]),
    DECAYS,
    st.sampled_from(["contained", "thresholded"]),
    st.booleans(),
)
def test_errors_are_those_of_a_snapshot_and_its_graph(
    walk: Walk,
    threshold: float,
    decay: float | None,
    truth: TruthKind,
    equivalences: bool,
) -> None:
    learner = msgspec.structs.replace(
        ENTRY,
        threshold=threshold,
        decay=decay,
        truth=truth,
        equivalences=equivalences,
    )
    assert errors(walk, learner).tolist() == one_by_one(walk, learner)


def test_the_thresholded_truth_is_that_of_the_learners_threshold() -> None:
    # Of seven places one is in the first field alone: 1/7 of the time.
    fields = np.array([[1, 1, 1, 0, 0, 0, 0], [0, 1, 1, 1, 1, 0, 0]], np.bool_)
    here = np.arange(7)
    walk = Walk(fields, np.stack([(here + 1) % 7, (here - 1) % 7]), np.array([0]))
    first = {
        tau: errors(
            walk, msgspec.structs.replace(ENTRY, threshold=tau, truth="thresholded")
        ).tolist()
        for tau in (0.14, 0.15)
    }
    assert first == {0.14: [0], 0.15: [2]}  # an edge and its contrapositive


@pytest.mark.parametrize("setting", [each.name for each in SETTINGS])
@pytest.mark.parametrize("decay", [None, 0.75])
@pytest.mark.parametrize("equivalences", [False, True])
def test_a_row_is_the_errors_of_its_walk(
    setting: str, decay: float | None, equivalences: bool
) -> None:
    cell = msgspec.structs.replace(
        ENTRY, setting=setting, decay=decay, equivalences=equivalences
    )
    walk = walks(setting, cell.seed, cell.runs, cell.steps)[1]
    row = cell.row(1)
    assert row.shape == cell.shape
    assert row.dtype == cell.dtype
    assert row.tolist() == one_by_one(walk, cell)


@pytest.mark.parametrize("setting", [each.name for each in SETTINGS])
@pytest.mark.parametrize("decay", [None, 0.9])
def test_plain_numpy_finds_the_same(setting: str, decay: float | None) -> None:
    cell = msgspec.structs.replace(ENTRY, setting=setting, decay=decay, threshold=0.1)
    ours, theirs = pace(cell, 200)  # raises where they differ
    assert min(ours, theirs) > 0


def test_all_that_matters_is_in_the_key() -> None:
    changes = {
        "setting": "grid",
        "threshold": 0.25,
        "decay": 0.5,
        "truth": "thresholded",
        "equivalences": True,
        "runs": 3,
        "steps": 301,
        "seed": 6,
    }
    assert set(changes) == set(ENTRY.__struct_fields__)
    others = {msgspec.structs.replace(ENTRY, **{k: v}).key for k, v in changes.items()}
    assert len(others | {ENTRY.key}) == len(changes) + 1


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_a_walk_makes_moves_that_the_world_makes(setting: object) -> None:
    env = gymnasium.make(setting.world).unwrapped  # type: ignore[attr-defined]
    walk = walks(setting.name, 2, 2, 2000)[1]  # type: ignore[attr-defined]
    _, info = env.reset(seed=next(s for s in range(1000) if starts(env, s, walk)))
    made = []
    for there in walk.places[1:].tolist():
        here = info["place"]
        fits = [a for a in range(len(walk.moves)) if walk.moves[a, here] == there]
        made.append(fits)
        observation, *_, info = env.step(np.int64(fits[0]))
        assert info["place"] == there
        if walk.fields is env.get_wrapper_attr("fields"):
            assert observation.tolist() == walk.views[there].tolist()
    # Each of the moves is as likely: five standard deviations around its share.
    share, clear = 1 / len(walk.moves), [fits[0] for fits in made if len(fits) == 1]
    for action in range(len(walk.moves)):
        expected = len(clear) * share
        assert abs(clear.count(action) - expected) < 5 * np.sqrt(expected)
    env.close()


def starts(env: gymnasium.Env[object, object], seed: int, walk: Walk) -> bool:
    return bool(env.reset(seed=seed)[1]["place"] == walk.places[0])


def test_fields_are_drawn_anew_for_every_run() -> None:
    drawn = walks("random", 0, 8, 5)
    assert len({walk.fields.tobytes() for walk in drawn}) == 8
    assert len({int(walk.places[0]) for walk in walks("path", 0, 30, 5)}) > 10


def test_fewer_and_shorter_walks_begin_the_longer_ones() -> None:
    few, many = walks("grid", 9, 2, 50), walks("grid", 9, 4, 80)
    for short, long in zip(few, many, strict=False):
        assert same(short.places, long.places[:50])
    assert not same(few[0].places, few[1].places)
    assert not same(few[0].places, walks("grid", 10, 1, 50)[0].places)


def test_each_setting_has_luck_of_its_own() -> None:
    # The two have the same places and moves: with the same draws their steps would
    # differ at the ends of the path only.
    path, random = walks("path", 0, 1, 2000)[0], walks("random", 0, 1, 2000)[0]
    alike = np.diff(path.places) == np.diff(random.places)
    assert alike.mean() < 0.7


def same(one: NDArray[np.intp], other: NDArray[np.intp]) -> bool:
    return np.array_equal(one, other)


def test_an_unknown_setting_is_named() -> None:
    rule = "^setting: must be one of path, cycle, grid, random, got 'torus'$"
    with pytest.raises(InvalidValueError, match=rule):
        walks("torus", 0, 1, 1)
