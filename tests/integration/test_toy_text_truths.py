"""What is true in worlds nobody made for us is found by plain arithmetic as well."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.body import Body
from neurosnap.agent.environment import Continuing
from neurosnap.agent.senses import Senses
from neurosnap.agent.sensor import Sensor, decreased, increased, one_hot
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import complete
from tests.support.toy_text_beds import BEDS, VARIANTS
from tests.support.transition_tables import Table, state_fields, transition_fields
from tests.support.true_orders import recordable
from world.implications import implications, inclusions
from world.toy_text import cliff_walking, frozen_lake, taxi


def readings(bed: Callable[..., BinarySensors]) -> dict[str, set[int]]:
    """Where each sensor should be on among the states of the table, by arithmetic."""
    states = set(Table.of(bed()).states.tolist())
    if bed is taxi:
        stops = ["red", "green", "yellow", "blue", "taxi"]
        where = {s: (s // 100, s // 20 % 5, s // 4 % 5, s % 4) for s in states}
        return {
            **{f"row<{k}": {s for s in states if where[s][0] < k} for k in range(1, 5)},
            **{
                f"column<{k}": {s for s in states if where[s][1] < k}
                for k in range(1, 5)
            },
            **{
                f"passenger={stop}": {s for s in states if where[s][2] == k}
                for k, stop in enumerate(stops)
            },
            **{
                f"destination={stop}": {s for s in states if where[s][3] == k}
                for k, stop in enumerate(stops[:4])
            },
        }
    width = 4 if bed is frozen_lake else 12
    tiles = {"start": {0}, "hole": {5, 7, 11, 12}, "goal": {15}}
    if bed is cliff_walking:
        tiles = {"start": {36}, "goal": {47}}
    return {
        **{f"row<{k}": {s for s in states if s // width < k} for k in range(1, 4)},
        **{
            f"column<{k}": {s for s in states if s % width < k} for k in range(1, width)
        },
        **{f"tile={tile}": places for tile, places in tiles.items()},
    }


@pytest.mark.parametrize("bed", BEDS)
def test_fields_and_truths_are_those_of_plain_arithmetic(
    bed: Callable[..., BinarySensors],
) -> None:
    env = bed()
    table = Table.of(env)
    fields = state_fields(env, table)
    expected = readings(bed)
    assert list(expected) == list(env.sensors)
    states = table.states.tolist()
    for name, field in zip(env.sensors, fields, strict=True):
        assert {states[k] for k in field.nonzero()[0]} == expected[name]
    everywhere = set(states)
    where = {}
    for name, on in expected.items():
        where[name], where[f"{name}*"] = on, everywhere - on
    truths = [
        (a, b)
        for a, b in itertools.product(where, repeat=2)
        if a.removesuffix("*") != b.removesuffix("*") and where[a] <= where[b]
    ]
    assert implications(env.sensors, fields) == truths


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_no_sensor_is_always_on_or_always_off(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    env = bed(**arguments)
    fields = state_fields(env, Table.of(env))
    assert fields.any(axis=1).all()
    assert not fields.all(axis=1).any()
    np.testing.assert_array_equal(recordable(fields), inclusions(fields))


def test_some_truths_in_words() -> None:
    def truths(env: BinarySensors) -> set[tuple[str, str]]:
        return set(implications(env.sensors, state_fields(env, Table.of(env))))

    lake = truths(frozen_lake())
    assert {("tile=goal", "row<3*"), ("tile=start", "column<1")} <= lake
    assert ("tile=hole", "row<1*") in lake
    assert ("tile=hole", "column<1*") not in lake  # there is one in the corner
    cliff = truths(cliff_walking())
    assert ("tile=goal", "row<3*") in cliff
    assert ("row<3*", "column<1") not in cliff  # the goal is in the bottom row, too
    cab = truths(taxi())
    assert ("passenger=taxi", "passenger=red*") in cab
    # Just delivered.
    assert ("passenger=red", "destination=red*") not in cab


def lake_with_changes() -> BinarySensors:
    """The lake with two sensors of order 1 among its own."""
    bare = frozen_lake()
    inner: Any = bare.unwrapped
    return BinarySensors(
        inner,
        [
            *one_hot("state", range(15)),
            increased("further"),
            decreased("back"),
        ],
        actions=bare.actions,
    )


@pytest.mark.parametrize("make", [frozen_lake, lake_with_changes])
def test_transitions_are_sensed_as_an_agent_senses_them(
    make: Callable[[], BinarySensors],
) -> None:
    env = make()
    table = Table.of(env)
    body = Body.full(env.sensors, env.actions, env.orders)
    senses = Senses(body)
    fields = transition_fields(env, table, body.context)
    assert fields.shape == (len(body.sensors), len(table.before))
    inner: Any = env.unwrapped
    column = {
        move: k for k, move in enumerate(zip(table.before, table.action, strict=True))
    }
    place = {state: k for k, state in enumerate(table.states.tolist())}
    going_on = Continuing(env)
    before = going_on.reset(seed=0)[0].astype(np.bool_)
    seen = set()
    for action in np.random.default_rng(0).integers(4, size=6000).tolist():
        k = column[(place[inner.s], action)]
        readings, _, _, _, info = going_on.step(action)
        after = readings.astype(np.bool_)
        assert info["begins"] == table.over[table.before[k]]
        taken = -1 if info["begins"] else action
        whole = senses.observe(after, taken, complete(before))
        np.testing.assert_array_equal(fields[:, k], whole)
        before = after
        seen.add(k)
    assert len(seen) == len(table.before)


@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_the_steps_of_a_walk_are_found_among_the_transitions(
    bed: Callable[..., BinarySensors], arguments: dict[str, Any]
) -> None:
    table = Table.of(bed(**arguments))
    places, actions = table.walk(2000, np.random.default_rng(8))
    columns = table.columns(places, actions)
    np.testing.assert_array_equal(table.before[columns], places[:-1])
    np.testing.assert_array_equal(table.action[columns], actions)
    np.testing.assert_array_equal(table.after[columns], places[1:])


def test_what_an_action_leads_to_is_a_truth_about_transitions() -> None:
    env = frozen_lake()
    body = Body.full(env.sensors, env.actions, env.orders)
    fields = transition_fields(env, Table.of(env), body.context)
    truths = set(implications(body.sensors, fields))
    assert ("left&column<1", "column<1") in truths
    assert ("left&column<2", "column<1") in truths
    assert ("right&~column<1", "column<1*") in truths  # a reset is nobody's doing
    assert ("right&~column<1", "column<2*") in truths
    assert ("down&~row<2", "row<2*") in truths
    assert ("up", "down*") in truths
    # Whoever is in a hole, or at the goal, takes no action there.
    felt = (fields.sum(axis=1) > 0).tolist()
    never = {s for s, on in zip(body.sensors, felt, strict=True) if not on}
    assert never == {
        f"{action}&tile={tile}" for action in env.actions for tile in ("hole", "goal")
    }


def test_sensors_of_too_high_an_order_are_refused() -> None:
    env = lake_with_changes()
    table = Table.of(env)
    with pytest.raises(InvalidValueError, match=r"^sensor further: must be of order 0"):
        state_fields(env, table)
    with pytest.raises(
        InvalidValueError, match=r"^context: must be of literals of state"
    ):
        transition_fields(env, table, [(0, 30)])
    older = BinarySensors(env.unwrapped, [Sensor("old", lambda *_: True, order=2)])
    with pytest.raises(InvalidValueError, match=r"^sensor old: must be of order 1"):
        transition_fields(older, table)
