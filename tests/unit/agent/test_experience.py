"""The agent's memory of places: episode ends and tried actions."""

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import BEGINNING, Experience
from neurosnap.agent.plan import ContingentPlan, Names, Plan
from neurosnap.sensorium import Sensorium

BODY = Body.full(["wall", "goal", "coin"], ["go", "stay"])
COIN = BODY.own.index("coin")
NAMES = Names(BODY.actions, Sensorium(BODY.sensors))


def place(**readings: bool) -> NDArray[np.bool_]:
    """What is sensed at a place; nothing of sensors that are not named."""
    found = np.zeros(2 * len(BODY.sensors), np.bool_)
    for name, on in readings.items():
        found[2 * BODY.own.index(name) + (not on)] = True
    return found


def by_chance(*actions: int) -> NDArray[np.bool_]:
    """What is left to chance if these actions toss the coin."""
    hopeless = np.zeros((len(BODY.actions), 2 * len(BODY.own)), np.bool_)
    for action in actions:
        hopeless[action, 2 * COIN : 2 * COIN + 2] = True
    return hopeless


def test_an_end_is_known_again_whatever_is_left_to_chance() -> None:
    experience = Experience(BODY)
    experience.leave(place(wall=False, goal=True, coin=True), ends=True)
    assert experience.is_end(place(wall=False, goal=True, coin=True), 0)
    assert not experience.is_end(place(wall=False, goal=True, coin=False), 0)
    # What may or may not be known of the coin: not knowing it is no end yet.
    imagined = place(wall=False, goal=True)
    assert not experience.is_end(imagined, 0)
    experience.give_up(by_chance(0))
    assert experience.is_end(imagined, 0)
    assert not experience.is_end(imagined, 1)  # by that action the coin can be told
    assert not experience.is_end(place(wall=True, goal=True), 0)
    assert not experience.is_end(place(goal=True), 0)


def test_who_is_not_shown_an_end_has_it_end_by_that_action_alone() -> None:
    experience = Experience(BODY)
    here = place(wall=False, goal=False, coin=True)
    experience.leave(here, ends=True, action=0)  # for all that is known, anything ends
    assert experience.is_end(here, 1)
    experience.leave(here, ends=False, action=1)
    assert not experience.is_end(here, 1)
    experience.leave(here, ends=True, action=0)
    assert not experience.is_end(here, 1)
    assert [experience.has_ended(here, action) for action in (0, 1)] == [True, False]
    assert experience.foresees_end(here, 0, place())
    # One who is set down elsewhere, and not told so, has not done what is known.
    experience.leave(here, ends=True, action=1)
    assert not experience.has_ended(here, 1)
    again = Experience(BODY)
    again.restore(experience.arrays())
    assert list(again.ended) == [(experience.key(here), 0)]
    again.give_up(by_chance(0, 1))
    assert again.has_ended(place(wall=False, goal=False, coin=False), 0)
    again.leave(here, ends=False, action=0)
    assert not again.has_ended(here, 0)


def test_a_place_is_by_chance_where_some_actions_toss_what_tells_it_apart() -> None:
    experience = Experience(BODY)
    imagined = place(wall=False, goal=True)
    assert not experience.by_chance(imagined, 0)
    experience.give_up(by_chance(0))
    assert experience.by_chance(imagined, 0)
    assert not experience.by_chance(imagined, 1)
    assert not experience.by_chance(place(wall=False, goal=True, coin=True), 0)
    experience.give_up(by_chance(0, 1))
    assert not experience.by_chance(imagined, 0)  # a coin, and no part of a place


def test_what_was_tried_is_known_again_once_all_actions_leave_a_sensor_to_chance() -> (
    None
):
    experience = Experience(BODY)
    heads, tails = (place(wall=True, goal=False, coin=on) for on in (True, False))
    experience.leave(heads, ends=False, action=1)
    assert (experience.key(heads), 1) in experience.tried
    assert (experience.key(tails), 1) not in experience.tried
    experience.give_up(by_chance(0))
    assert (experience.key(tails), 1) not in experience.tried
    experience.give_up(by_chance(0, 1))
    assert (experience.key(tails), 1) in experience.tried
    assert (experience.key(tails), 0) not in experience.tried
    assert len(experience.tried) == 1
    other = Experience(BODY)
    other.restore(experience.arrays())
    other.give_up(by_chance(0, 1))
    assert list(other.tried) == list(experience.tried)
    assert (other.key(tails), 1) in other.tried


def test_a_trial_is_where_all_seemed_to_be_known_and_it_was_never_taken() -> None:
    experience = Experience(BODY)
    here, there = place(wall=True, goal=False, coin=True), place(goal=True)
    came = place(wall=False, goal=False, coin=True)[: 2 * len(BODY.own)]
    other = place(wall=True, goal=False, coin=True)[: 2 * len(BODY.own)]
    experience.count_trial(0, here, place(wall=False)[: 2 * len(BODY.own)], came)
    assert experience.hope(0) == 1 / 2  # not all was foretold
    experience.count_trial(0, here, other, came)
    assert experience.hope(0) == 2 / 3
    experience.count_trial(0, there, came, came)
    assert experience.hope(0) == 2 / 4
    assert experience.hope(1) == 1 / 2
    experience.leave(here, ends=False, action=0)
    experience.count_trial(0, here, other, came)
    assert experience.hope(0) == 2 / 4  # it was taken there before
    # What is left to chance need not be foretold.
    experience.give_up(by_chance(1))
    experience.count_trial(1, here, came & ~by_chance(1)[1], came)
    assert experience.hope(1) == 1 / 3
    again = Experience(BODY)
    again.restore(experience.arrays())
    assert [again.hope(a) for a in (0, 1)] == [2 / 4, 1 / 3]


def test_an_episode_that_begins_where_nothing_was_done_is_a_surprise() -> None:
    experience = Experience(BODY)
    here, there = place(wall=True), place(wall=False)
    experience.begin(here)
    assert experience.hope(BEGINNING) == 2 / 3
    experience.leave(here, ends=False, action=1)
    experience.begin(here)
    assert experience.hope(BEGINNING) == 2 / 4
    experience.begin(there)
    assert experience.hope(BEGINNING) == 3 / 5


def test_a_plan_of_either_kind_is_stored_and_goes_on() -> None:
    experience, again = Experience(BODY), Experience(BODY)
    here, gone = place(wall=True, goal=False), place(wall=False)
    places = np.stack([here, gone])
    ways, shares = np.array([[0, 1, -1], [0, -1, -1]]), np.full((2, 3), 0.75)
    worth = np.array([0.5, 0.25])
    experience.asked_until = 3
    experience.plan = ContingentPlan(
        np.array([1, 0]), places, "arrives", worth, 7, ways, shares
    )
    again.restore(experience.arrays())
    assert isinstance(again.plan, ContingentPlan)
    state = here | place(coin=True)
    assert again.plan.goes_on(state, 7)
    assert not again.plan.goes_on(state, 8)
    assert not again.plan.goes_on(place(wall=True), 7)
    assert again.plan.step(state)[0] == 1
    assert again.asked_until == 3
    said = "arrives with a chance of 50 %: stay, which led to no change (75 %), "
    assert again.plan.reason(state, NAMES) == f"{said}wall* (75 %)"
    assert again.plan.reason(gone, NAMES) == "arrives with a chance of 25 %: go"
    for name, wrong in ("after", 2), ("after", -2), ("until", -1), ("asked", -1):
        arrays = experience.arrays()
        arrays[name] = np.full_like(arrays[name], wrong)
        with pytest.raises(ValueError, match=rf"^{name}: must be "):
            Experience(BODY).restore(arrays)
    experience.plan = Plan((1,), here[None], "to test what stay does there, ")
    other = Experience(BODY)
    other.restore(experience.arrays())
    assert isinstance(other.plan, Plan)
    assert other.plan.reason(state, NAMES) == (
        "to test what stay does there, in 1: stay"
    )
