"""What is true equals its definition, and a walk's law is the one it tends to."""

from fractions import Fraction

import gymnasium
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments.truth import (
    codes_of,
    contained,
    stationary,
    thresholded,
)
from neurosnap.apps.figures.experiments.walks import SETTINGS, walks
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.pair_codes import rows_of
from neurosnap.poc.order.literals import from_words

Fields = NDArray[np.bool_]
Moves = NDArray[np.intp]


def fields_of() -> st.SearchStrategy[Fields]:
    shapes = hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=6)
    return hnp.arrays(np.bool_, shapes)


@st.composite
def moves_of(draw: st.DrawFn) -> Moves:
    places = draw(st.integers(1, 6))
    actions = draw(st.integers(1, 3))
    return draw(
        hnp.arrays(np.intp, (actions, places), elements=st.integers(0, places - 1))
    )


def tended_to(moves: Moves, start: int) -> NDArray[np.float64]:
    """Where a walk that stays put every other step ends up; its law is the same."""
    places = moves.shape[1]
    lazy = np.eye(places) / 2
    for leads in moves:
        for place, there in enumerate(leads):
            lazy[place, there] += 0.5 / len(moves)
    law: NDArray[np.float64] = np.linalg.matrix_power(lazy, 2**20)[start]
    return law


def recurrent_parts(moves: Moves, start: int) -> int:
    def reach(place: int) -> frozenset[int]:
        found, pending = set[int](), [place]
        while pending:
            here = pending.pop()
            if here not in found:
                found.add(here)
                pending += moves[:, here].tolist()
        return frozenset(found)

    return len({reach(x) for x in reach(start) if all(x in reach(y) for y in reach(x))})


@given(moves_of(), st.data())
def test_a_law_is_what_the_walk_tends_to(moves: Moves, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, moves.shape[1] - 1))
    assume(recurrent_parts(moves, start) == 1)
    law = stationary(moves, start)
    assert law.sum() == pytest.approx(1)
    assert law == pytest.approx(tended_to(moves, start), abs=1e-9)


@given(hnp.arrays(np.intp, (3, 6), elements=st.integers(0, 5)))
def test_a_walk_that_may_be_caught_here_or_there_has_no_law(moves: Moves) -> None:
    moves[:, 0], moves[:, 1], moves[:2, 2] = 0, 1, [0, 1]
    assert recurrent_parts(moves, 2) > 1
    with pytest.raises(InvalidValueError, match=r"^start: must lead to one recurrent"):
        stationary(moves, 2)


def test_the_law_of_each_setting_is_uniform() -> None:
    for setting in SETTINGS:
        walk = walks(setting.name, 3, 1, 1)[0]
        places = walk.moves.shape[1]
        assert walk.law == pytest.approx(np.full(places, 1 / places))


def test_a_walk_keeps_to_its_own_part_of_the_space() -> None:
    moves = np.array([[1, 0, 3, 2], [0, 1, 2, 3]])
    assert stationary(moves, 2) == pytest.approx([0, 0, 0.5, 0.5])


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_containments_are_the_worlds_implications(setting: object) -> None:
    env = gymnasium.make(setting.world).unwrapped  # type: ignore[attr-defined]
    env.reset(seed=4)
    names = env.get_wrapper_attr("sensors")
    codes = contained(env.get_wrapper_attr("fields"))
    literals = [literal for name in names for literal in (name, f"{name}*")]
    edges = from_words(rows_of(codes, len(names)), 2 * len(names))
    found = [(literals[a], literals[b]) for a, b in np.argwhere(edges)]
    assert found == env.get_wrapper_attr("implications")
    env.close()


@given(
    fields_of(), st.sampled_from([1 / 4, 1 / 10, 1 / 3 - 1 / 12, 1e-3]), st.booleans()
)
def test_thresholded_truth_is_its_definition(
    fields: Fields, threshold: float, equivalences: bool
) -> None:
    sensors, places = fields.shape
    law = np.full(places, 1 / places)

    def weight(a: int, b: int) -> Fraction:
        on = [fields[a // 2, x] != a % 2 and fields[b // 2, x] != b % 2 for x in xs]
        return Fraction(sum(on), places)

    xs = range(places)
    # As exact as the threshold was meant: 1e-15 beside a multiple of 1/places is it.
    tau = Fraction(threshold).limit_denominator(1000)
    edges = np.zeros((2 * sensors, 2 * sensors), np.bool_)
    for a, b in np.argwhere(~edges):
        if a // 2 != b // 2:
            against, converse = weight(a, b ^ 1), weight(a ^ 1, b)
            rest = weight(a, b), weight(a ^ 1, b ^ 1)
            edges[a, b] = against < min(tau, converse, *rest)
            edges[a, b] |= equivalences and against == converse == 0
    found = rows_of(thresholded(fields, law, threshold, equivalences), sensors)
    assert (from_words(found, 2 * sensors) == edges).all()


@given(hnp.arrays(np.uint8, 10, elements=st.integers(0, 15)))
def test_codes_and_edges_are_the_same(codes: NDArray[np.uint8]) -> None:
    assert (codes_of(from_words(rows_of(codes, 5), 10)) == codes).all()
