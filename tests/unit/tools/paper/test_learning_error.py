"""Learning errors, ground truth, means and fitted rates match their definitions."""

from fractions import Fraction

import gymnasium
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from neurosnap.poc.learning.pairs import rows_of
from neurosnap.poc.order.literal_sets import from_words
from tests.support.edges import edge_matrix, learned_edges
from tools.paper.curves import Curve, fitted
from tools.paper.learning_error import LearningEntry, new_snapshot
from tools.paper.walks import SETTINGS, codes_of, stationary, thresholded, walk

Fields = NDArray[np.bool_]


@pytest.mark.slow
@pytest.mark.parametrize(("setting", "decay"), [("grid", None), ("random", 0.75)])
def test_a_row_is_how_far_each_graph_is_from_the_truth(
    setting: str, decay: float | None
) -> None:
    cell = LearningEntry(
        setting=setting,
        threshold=1 / 8000,
        decay=decay,
        truth="contained",
        runs=2,
        steps=120,
        seed=5,
    )
    seen = walk(setting, cell.seed, 1, cell.steps)
    true = from_words(rows_of(seen.contained, 20), 40)
    snapshot, expected = new_snapshot(cell.threshold, decay, 20), []
    for place in seen.places:
        snapshot.learn(seen.fields[:, place])
        edges = edge_matrix(40, learned_edges(snapshot, equivalences=False))
        expected.append(int((edges != true).sum()))
    row = cell.row(1)
    assert row.tolist() == expected


def test_longer_walks_begin_like_shorter_ones_and_runs_differ() -> None:
    long, other = walk("grid", 9, 0, 80), walk("grid", 9, 1, 80)
    assert (walk("grid", 9, 0, 50).places == long.places[:50]).all()
    assert (long.places != other.places).any()
    assert len({walk("random", 0, run, 5).fields.tobytes() for run in range(8)}) == 8


@pytest.mark.parametrize("name", SETTINGS)
def test_containments_are_the_worlds_implications(name: str) -> None:
    env = gymnasium.make(SETTINGS[name].world).unwrapped
    key = np.random.SeedSequence(3, spawn_key=(list(SETTINGS).index(name), 0))
    env.reset(seed=int(key.spawn(2)[0].generate_state(1)[0]))
    there = walk(name, 3, 0, 1)
    names = env.get_wrapper_attr("sensors")
    literals = [literal for name in names for literal in (name, f"{name}*")]
    edges = from_words(rows_of(there.contained, len(names)), 2 * len(names))
    found = [(literals[a], literals[b]) for a, b in np.argwhere(edges)]
    assert found == env.get_wrapper_attr("implications")
    env.close()


def test_a_law_is_that_of_the_part_a_walk_keeps_to() -> None:
    moves = np.array([[1, 0, 3, 2], [0, 1, 2, 3]])
    assert stationary(moves, 2) == pytest.approx([0, 0, 0.5, 0.5])
    assert stationary(np.array([[1, 1, 0], [1, 2, 1]]), 0) == pytest.approx(
        [0.2, 0.6, 0.2], abs=0.2
    )
    for name in SETTINGS:
        law = walk(name, 3, 0, 1).law
        assert law == pytest.approx(np.full(len(law), 1 / len(law)))


@given(
    hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=6)),
    st.sampled_from([1 / 4, 1 / 10, 1e-3]),
)
def test_thresholded_truth_is_its_definition(fields: Fields, threshold: float) -> None:
    sensors, places = fields.shape

    def weight(a: int, b: int) -> Fraction:
        on = (fields[a // 2] != a % 2) & (fields[b // 2] != b % 2)
        return Fraction(int(on.sum()), places)

    # As exact as the threshold was meant: 1e-15 beside a multiple of 1/places is it.
    tau = Fraction(threshold).limit_denominator(1000)
    edges = np.zeros((2 * sensors, 2 * sensors), np.bool_)
    for a, b in np.argwhere(~edges).tolist():
        if a // 2 != b // 2:
            rest = weight(a ^ 1, b), weight(a, b), weight(a ^ 1, b ^ 1)
            edges[a, b] = weight(a, b ^ 1) < min(tau, *rest)
    law = np.full(places, 1 / places)
    found = rows_of(thresholded(fields, law, threshold), sensors)
    assert (from_words(found, 2 * sensors) == edges).all()


@given(hnp.arrays(np.uint8, 10, elements=st.integers(0, 15)))
def test_codes_and_edges_are_the_same(codes: NDArray[np.uint8]) -> None:
    assert (codes_of(from_words(rows_of(codes, 5), 10)) == codes).all()


ENTRY = LearningEntry(
    setting="path",
    threshold=1 / 8000,
    decay=None,
    truth="contained",
    runs=2,
    steps=300,
    seed=5,
)


def curve(*rows: list[int] | list[float]) -> Curve:
    table = np.array(rows).round().astype(np.uint16)
    runs, steps = table.shape
    return Curve(msgspec.structs.replace(ENTRY, runs=runs, steps=steps), table)


def falling(half_life: float, steps: int = 400, floor: float = 0) -> Curve:
    top = 40_000
    return curve((top * 2.0 ** (-np.arange(steps) / half_life) + floor).tolist())


def test_a_curve_is_the_mean_of_its_runs_its_level_that_of_the_last_tenth() -> None:
    assert curve([100] * 18 + [6, 2]).level == 4
    assert curve([8, 2]).level == 2
    found = curve([4, 2, 2, 0], [4, 4, 0, 0])
    assert found.mean.tolist() == [4, 3, 1, 0]
    assert (found.woken, found.peak, found.halved) == (2, 1, 3)
    assert found.reaches_zero
    assert not curve([4, 0], [4, 2]).reaches_zero


def test_the_peak_is_its_last_step_and_the_wait_is_counted_from_it() -> None:
    found = curve([1, 9, 9, 8, 4, 9, 5, 4])
    assert found.peak == 6
    assert found.halved == 8
    flat = curve([6] * 20)
    assert (flat.peak, flat.halved, flat.woken) == (20, None, None)


@given(st.floats(5, 40))
def test_the_rate_of_an_exponential_is_found(half_life: float) -> None:
    fit = fitted(falling(half_life))
    assert fit is not None
    assert fit.half_life == pytest.approx(half_life, rel=0.03)  # it is rounded to edges
    assert fit.rate == pytest.approx(np.log(2) / fit.half_life)
    assert fit.r2 > 0.99
    assert fit.first == 1


def test_the_fit_ends_where_the_plateau_begins() -> None:
    found = falling(10, floor=100)
    fit = fitted(found)
    assert fit is not None
    assert found.mean[fit.last - 1] <= 110 < found.mean[fit.last - 2]


def test_the_fit_ends_with_the_first_mean_of_one_edge_or_less() -> None:
    rows = [[64, 32, 16, 8, 4, 2, 2, 0, 0, 50] + [0] * 20] * 3
    rows.append([64, 32, 16, 8, 4, 2, 0, 0, 0, 50] + [0] * 20)
    fit = fitted(curve(*rows))
    assert fit is not None
    assert (fit.first, fit.last) == (1, 7)


@pytest.mark.parametrize(
    "row",
    [
        [50] * 30,  # nothing falls
        list(range(1, 31)),  # it rises
        [50] * 10 + [30] * 20,  # it does not halve
        [50] * 10 + [0] * 20,  # it falls at once
        [0] * 30,
        [7],
    ],
)
def test_what_does_not_decay_has_no_rate(row: list[int]) -> None:
    assert fitted(curve(row)) is None
