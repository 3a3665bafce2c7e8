"""A random walk in worlds nobody made for us learns exactly what is true."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.body import Body
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tests.support.exhaustive import rows
from tests.support.taught_agents import THRESHOLDS
from tests.support.toy_text_beds import BEDS
from tests.support.transition_tables import Table, state_fields, transition_fields
from tests.support.true_orders import learn, rarest_pair, recordable
from world.implications import inclusions
from world.toy_text import cliff_walking, frozen_lake, taxi

Fields = NDArray[np.bool_]


@st.composite
def all_fields(draw: st.DrawFn) -> Fields:
    places = draw(st.integers(1, 4))
    rows = st.lists(st.booleans(), min_size=places, max_size=places)
    return np.array(draw(st.lists(rows, min_size=1, max_size=6)), np.bool_)


@given(all_fields())
def test_what_can_be_recorded_is_what_is_recorded_after_seeing_everything(
    fields: Fields,
) -> None:
    places = fields.shape[1]
    snapshot = EmpiricalSnapshot(len(fields), 1 / (4 * places))
    for bits in fields.T:
        snapshot.learn(bits)
    np.testing.assert_array_equal(recordable(fields), snapshot.poc_graph().edges)


@given(all_fields())
def test_what_cannot_be_recorded_is_what_follows_from_nothing(fields: Fields) -> None:
    literals = [field for pair in fields for field in (pair, ~pair)]
    lacking = inclusions(fields) & ~recordable(fields)
    for a, b in itertools.product(range(len(literals)), repeat=2):
        low, high = literals[a], literals[b]
        trivial = not low.any() or bool(high.all())
        assert lacking[a, b] == (a >> 1 != b >> 1 and trivial and (low != high).any())


@given(all_fields())
def test_the_rarest_pair_is_the_least_weight_of_a_free_square(fields: Fields) -> None:
    shares = np.arange(1, fields.shape[1] + 1) / np.arange(1, fields.shape[1] + 1).sum()
    least = 1.0
    for one, two in itertools.combinations(fields, 2):
        square = [a & b for a in (one, ~one) for b in (two, ~two)]
        if all(cell.any() for cell in square):
            least = min(least, *(float(shares[cell].sum()) for cell in square))
    assert rarest_pair(fields, shares) == pytest.approx(least)


def test_errors_are_counted_at_every_step() -> None:
    env = frozen_lake()
    table = Table.of(env)
    fields = state_fields(env, table)
    truth = {
        (a, b)
        for a, b in itertools.product(range(18), repeat=2)
        if a >> 1 != b >> 1
        and not ((fields[a >> 1] ^ a & 1) & ~(fields[b >> 1] ^ b & 1)).any()
    }
    places, _ = table.walk(299, np.random.default_rng(4))
    snapshot = EmpiricalSnapshot(9, 0.001)
    expected = []
    for place in places:
        snapshot.observe(fields[:, place])
        edges = {(int(a), int(b)) for a, b in np.argwhere(snapshot.poc_graph().edges)}
        expected.append(len(edges ^ truth))
    assert learn(fields, places, 0.001).tolist() == expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", rows([0], [1, 2]))
@pytest.mark.parametrize(
    ("bed", "threshold", "steps"),
    [
        (frozen_lake, 1e-4, 10_000),
        (cliff_walking, 1e-5, 100_000),
        (taxi, 1e-5, 200_000),
    ],
)
def test_a_random_walk_learns_exactly_what_is_true(
    bed: Callable[..., BinarySensors], threshold: float, steps: int, seed: int
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    assert threshold < rarest_pair(fields, table.stationary())
    places, _ = table.walk(steps, np.random.default_rng(seed))
    errors = learn(fields, places, threshold)
    assert errors[0] > 0
    assert not errors[-steps // 5 :].any()


@pytest.mark.slow
@pytest.mark.parametrize("bed", BEDS)
def test_a_threshold_above_the_rarest_pair_keeps_something_false(
    bed: Callable[..., BinarySensors],
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    threshold = 3 * rarest_pair(fields, table.stationary())
    places, _ = table.walk(200_000, np.random.default_rng(0))
    assert learn(fields, places, threshold)[-50_000:].all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bed", "steps"), [(frozen_lake, 8000), (cliff_walking, 80_000)]
)
def test_a_random_walk_learns_exactly_what_its_actions_lead_to(
    bed: Callable[..., BinarySensors], steps: int
) -> None:
    env = bed()
    table = Table.of(env)
    body = Body.full(env.sensors, env.actions, env.orders)
    fields = transition_fields(env, table, body.context)
    chances = table.chance / table.actions * table.stationary()[table.before]
    assert chances.sum() == pytest.approx(1)
    assert THRESHOLDS[bed] < rarest_pair(fields, chances)
    columns = table.columns(*table.walk(steps, np.random.default_rng(0)))
    assert not learn(fields, columns, THRESHOLDS[bed])[-steps // 5 :].any()
