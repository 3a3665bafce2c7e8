"""Plans where chance decides, held against tables that are counted and solved apart."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.chances import DISCOUNT, PATIENCE, SURE, plan_by_chance
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.plan import ContingentPlan, Names
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import Sensorium, complete

WALK = Body.full(["here", "there", "goal"], ["left", "right"], room=1)
NAMES = len(WALK.sensors)
FULL = WALK.grow(Context(0, (0, 3)))  # it has no room for more


def seen(
    history: History,
    own: list[int],
    action: int = -1,
    known: bool = True,
    ended: bool = False,
) -> None:
    """Record what was read after an action; none begins a trajectory."""
    bits = np.zeros(NAMES, np.bool_)
    bits[: len(own)] = own
    if action >= 0:
        bits[len(own) + action] = True
    sure = np.ones(NAMES, np.bool_)
    sure[0] = known
    history.record(bits, sure, action < 0, ended)


def plan(
    history: History,
    own: list[int],
    *target: int,
    doubted: Sequence[int] = (),
    prefers: Mapping[int, float] | None = None,
    explores: bool = True,
    body: Body = WALK,
) -> tuple[ContingentPlan | None, NDArray[np.bool_]]:
    state = np.zeros(2 * NAMES, np.bool_)
    state[: 2 * len(own)] = complete(np.array(own, np.bool_))
    coins = np.isin(np.arange(len(own)), doubted)
    told = history, state, coins, explores
    asking = plan_by_chance(body, target, prefers or {}, *told)
    return answered(asking, history.answer), state


def place_in(found: ContingentPlan, own: list[int]) -> int:
    """Return which of a plan's places reads so; -1 if it has none."""
    literals = complete(np.array(own, np.bool_))
    rows = np.flatnonzero((found.places[:, : 2 * len(own)] == literals).all(axis=1))
    return int(rows[0]) if rows.size else -1


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 1), st.integers(0, 3)),
        min_size=1,
        max_size=40,
    )
)
def test_no_plan_has_a_greater_chance(moved: list[tuple[int, int, int]]) -> None:
    """Places 0 to 2, and the goal; held against all plans there are."""
    codes = ([0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1])
    history = History(NAMES, 128)
    for start, action, after in moved:
        seen(history, codes[start])
        seen(history, codes[after], action)
    times = np.zeros((3, 2, 4))
    for move in moved:
        times[move] += 1
    tried = times.sum(axis=2)

    def chances(actions: Sequence[int], discount: float) -> NDArray[np.float64]:
        """The chance to arrive from each place, if this is done there."""
        led, fixed = np.eye(4), np.array([0, 0, 0, 1.0])
        for place, action in enumerate(actions):
            if action >= 0 and tried[place, action]:
                share = discount * times[place, action] / tried[place, action]
                led[place] -= share
        return np.asarray(np.linalg.lstsq(led, fixed)[0][:3], np.float64)

    every = list(product((0, 1), repeat=3))
    best = np.max([chances(each, PATIENCE) for each in every], axis=0)
    for place in range(3):
        found, state = plan(history, codes[place], 4)
        # A place of which no move is remembered has no row in a table.
        if best[place] < 1e-6:
            assert found is None
            continue
        assert found is not None
        action, again = found.step(state)
        assert again is found
        others = [a for a in every if a[place] == action]
        reached = max(chances(each, PATIENCE)[place] for each in others)
        assert abs(reached - best[place]) < 1e-4
        rows = [place_in(found, own) for own in codes[:3]]
        taken = [int(found.actions[row]) if row >= 0 else -1 for row in rows]
        shown = found.values[rows[place]]
        assert abs(shown - chances(taken, 1.0)[place]) < 1e-2


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 1), st.integers(0, 3)),
        min_size=1,
        max_size=40,
    ),
    st.floats(-3, 3),
    st.floats(-3, 3),
)
def test_no_plan_gets_more_of_what_is_preferred(
    moved: list[tuple[int, int, int]], here: float, missed: float
) -> None:
    """Places 0 to 2; what leads to 3 ends where it looks as it did before."""
    codes = ([0, 0, 0], [1, 0, 0], [0, 1, 0])
    history = History(NAMES, 128)
    ended = False
    gains, times = np.zeros((3, 2)), np.zeros((3, 2, 4))
    for start, action, after in moved:
        seen(history, codes[start], ended=ended)
        code = codes[start if after == 3 else after]
        seen(history, code, action)
        ended = after == 3
        times[start, action, after] += 1
        gains[start, action] += here * code[0] + missed * (not code[1])
    seen(history, codes[0], ended=ended)
    tried = times.sum(axis=2)

    def worth(actions: Sequence[int]) -> NDArray[np.float64] | None:
        """What is got from each place, if this is done there."""
        led, fixed = np.eye(4), np.zeros(4)
        for place, action in enumerate(actions):
            if tried[place].any() and not tried[place, action]:
                return None  # it is not known what that does
            if tried[place, action]:
                led[place] -= DISCOUNT * times[place, action] / tried[place, action]
                fixed[place] = gains[place, action] / tried[place, action]
        return np.asarray(np.linalg.solve(led, fixed)[:3], np.float64)

    known = [w for a in product((0, 1), repeat=3) if (w := worth(a)) is not None]
    best = np.max(known, axis=0)
    found, _ = plan(history, codes[0], prefers={0: here, 3: missed}, explores=False)
    assert found is not None
    for place in np.flatnonzero(tried.any(axis=1)).tolist():
        row = place_in(found, codes[place])
        assert abs(found.values[row] - best[place]) < 1e-3
        state = np.concatenate((complete(np.array(codes[place], np.bool_)), [False]))
        assert found.goes_on(np.pad(state, (0, 2 * NAMES - 7)), history.tick)


def test_what_is_only_preferred_makes_no_place() -> None:
    body = Body.full(["here", "won"], ["go"], [0, 1], room=1)
    history, rng = History(len(body.sensors), 1024), np.random.default_rng(2)
    state = np.zeros(2 * len(body.sensors), np.bool_)
    state[1] = True
    for here in rng.integers(2, size=1000).tolist():
        bits = np.zeros(len(body.sensors), np.bool_)
        bits[:3] = here, here and rng.random() < 0.5, True
        history.record(bits)
    asking = plan_by_chance(body, (), {2: 1.0}, history, state, np.zeros(2, np.bool_))
    found = answered(asking, history.answer)
    assert found is not None
    assert (found.actions >= 0).sum() == 2
    each = found.values[found.actions >= 0] * (1 - DISCOUNT)
    assert np.abs(each - 0.25).max() < 0.03  # half of what is here, which is half


def test_what_may_be_a_coin_is_left_out_unless_it_tells() -> None:
    history, rng = History(NAMES, 2048), np.random.default_rng(6)
    for _ in range(500):
        here, coin = rng.integers(2, size=2).tolist()
        seen(history, [here, coin, 0])
        luck = rng.random() < 0.5
        seen(history, [0, int(rng.integers(2)), int(here and luck)], 0)
    found, state = plan(history, [1, 0, 0], 4, doubted=[0, 1])
    assert found is not None
    (row,) = np.flatnonzero(found.actions >= 0)
    assert found.places[row].sum() == 2  # where it is, and whether it has arrived
    assert abs(found.values[row] - 0.5) < 0.1
    assert found.goes_on(state, history.tick)
    assert plan(history, [0, 0, 0], 4, doubted=[0, 1])[0] is None


def test_where_all_are_coins_there_is_no_place_and_no_plan() -> None:
    history, rng = History(NAMES, 2048), np.random.default_rng(6)
    assert plan(history, [0, 0, 0])[0] is None
    for _ in range(500):
        seen(history, rng.integers(2, size=3).tolist())
        seen(history, rng.integers(2, size=3).tolist(), 0)
    assert plan(history, [0, 0, 0], doubted=[0, 1, 2])[0] is None


def test_one_that_explores_goes_to_what_was_hardly_tried() -> None:
    history = History(NAMES, 256)
    here, there = [1, 0, 0], [0, 1, 0]
    for turn in range(SURE + 8):
        seen(history, here)
        seen(history, there if turn % 2 else here, 0)  # left slips
        seen(history, here)
        seen(history, here, 1)
    assert plan(history, here)[0] is None  # all that was left is known
    seen(history, there)
    seen(history, here, 1)
    found, state = plan(history, there)
    assert found is not None
    assert found.step(state)[0] == 0  # which was never taken there
    assert found.until == history.tick + SURE
    found, state = plan(history, here)
    assert found is not None
    assert found.step(state)[0] == 0
    names = Names(WALK.actions, Sensorium(WALK.sensors))
    says = "comes to what was hardly tried: left, which led to here* there (50 %), "
    assert found.reason(state, names) == f"{says}no change (50 %)"


def test_where_nothing_slips_nothing_is_explored_by_chance() -> None:
    history = History(NAMES, 64)
    seen(history, [1, 0, 0])
    seen(history, [0, 1, 0], 0)
    assert plan(history, [1, 0, 0])[0] is None


@pytest.mark.parametrize("body", [WALK, FULL])
def test_where_nothing_slips_one_try_is_enough(body: Body) -> None:
    history, here, goal = History(NAMES, 64), [1, 0, 0], [0, 0, 1]
    for before, action, after in ((here, 0, here), (here, 1, goal), (goal, 1, here)):
        seen(history, before)
        seen(history, after, action)
    found, state = plan(history, here, prefers={4: 1.0}, body=body)
    assert found is not None
    assert found.step(state)[0] == 1
    found, state = plan(history, goal, prefers={4: 1.0}, body=body)
    assert found is not None
    assert found.step(state)[0] == 0  # which was never taken there


def test_the_unit_of_what_is_preferred_does_not_matter() -> None:
    history, here, there, goal = History(NAMES, 64), [1, 0, 0], [0, 1, 0], [0, 0, 1]
    moves = (here, 0, here), (here, 1, there), (there, 0, goal), (goal, 0, goal)
    for before, action, after in moves:
        seen(history, before)
        seen(history, after, action)
    for unit in (1e-9, 1.0, 1e9):
        found, state = plan(history, here, prefers={4: unit}, explores=False)
        assert found is not None
        assert found.step(state)[0] == 1
        at = place_in(found, here)
        assert found.values[at] / unit == pytest.approx(0.99 / 0.01, rel=1e-4)


@pytest.mark.parametrize("explores", [True, False])
def test_where_places_look_alike_no_plan_takes_them_for_one(explores: bool) -> None:
    history = History(NAMES, 1024)
    dark, goal = [0, 0, 0], [0, 0, 1]
    for _ in range(60):  # the second dark place leads on, the first does not
        seen(history, [1, 0, 0])
        seen(history, dark, 0)
        seen(history, dark, 0)
        seen(history, goal, 0)
    assert plan(history, dark, 4)[0] is None
    found, _ = plan(history, dark, 4, explores=explores, body=FULL)
    assert found is not None  # there is nothing better
    assert (found.why, found.until) == ("guesses", history.tick + SURE)
    names = Names(WALK.actions, Sensorium(WALK.sensors))
    state = complete(np.zeros(NAMES, np.bool_))
    says = "cannot tell some places apart, and guesses: left, which led to no change"
    assert found.reason(state, names) == f"{says} (50 %), goal (50 %)"


def test_what_was_sensed_a_step_before_is_part_of_a_place_as_far_as_it_tells() -> None:
    history, rng = History(NAMES, 1024), np.random.default_rng(0)
    here, dark, goal = [1, 0, 0], [0, 0, 0], [0, 0, 1]
    table = {"here": (here, ("dark", "here")), "dark": (dark, ("darker", "here"))}
    table |= {"darker": (dark, ("here", "goal")), "goal": (goal, ("here", "here"))}
    contexts = np.array(WALK.context)

    def sensed(own: list[int], action: int, before: list[int]) -> NDArray[np.bool_]:
        literals = complete(np.array(before, np.bool_))
        acted = np.arange(2) == action
        single = (contexts[:, 0] == action) & literals[contexts[:, 1]]
        return np.concatenate((np.array(own, np.bool_), acted, single, [False]))

    at = "here"
    states = {at: sensed(here, -1, here)}
    history.record(states[at], None, True, False)
    for _ in range(400):
        action, before = int(rng.integers(2)), table[at][0]
        at = table[at][1][action]
        states[at] = sensed(table[at][0], action, before)
        history.record(states[at], None, False, False)
    for explores in (True, False):
        asking = plan_by_chance(
            WALK,
            [4],
            {},
            history,
            complete(states["dark"]),
            np.zeros(3, np.bool_),
            explores,
        )
        found = answered(asking, history.answer)
        assert found is not None
        places = "here", "dark", "darker"
        ways = [found.step(complete(states[place]))[0] for place in places]
        assert ways == [0, 0, 1]
        assert found.values[found.actions >= 0] == pytest.approx(1)


def test_where_no_way_is_known_and_nothing_can_be_grown_it_tries() -> None:
    history, here, there = History(NAMES, 256), [1, 0, 0], [0, 1, 0]
    for before, action, after in ((here, 0, here), (here, 1, there), (there, 0, here)):
        seen(history, before)
        seen(history, after, action)
    assert plan(history, here, 4)[0] is None  # nobody was at the goal
    names = Names(FULL.actions, Sensorium(FULL.sensors))
    found, state = plan(history, here, 4, body=FULL)
    assert found is not None
    assert found.step(state)[0] == 1  # to where something was never done
    says = "knows no way, and comes to what was hardly tried: right"
    assert found.reason(state, names) == says
    seen(history, here)
    seen(history, [0, 0, 1], 0)  # a way that leads there half the time
    found, state = plan(history, here, 4, body=FULL)
    assert found is not None
    assert found.step(state)[0] == 0
    assert found.reason(state, names).startswith("arrives with a chance of ")


def test_where_nothing_can_be_grown_what_was_not_tried_is_gone_for() -> None:
    history, here, there = History(NAMES, 256), [1, 0, 0], [0, 1, 0]
    for before, action, after in ((here, 0, here), (here, 1, there), (there, 0, here)):
        seen(history, before)
        seen(history, after, action)
    assert plan(history, here)[0] is None
    names = Names(FULL.actions, Sensorium(FULL.sensors))
    for _ in range(2):
        found, state = plan(history, here, body=FULL)
        assert found is not None
        action, rest = found.step(state)
        assert action == 1  # to where something was never done, or once only
        assert rest is found
        _, state = plan(history, there)
        assert found.reason(state, names) == "comes to what was seldom tried: right"
        action, rest = found.step(state)
        assert action == 1
        assert not rest.goes_on(state, history.tick)  # once is enough
        assert found.step(state)[0] == 1  # as the plan is what it was
        seen(history, there)
        seen(history, there, 1)
        for before, action, after in ((here, 0, here), (here, 1, there)):
            seen(history, before)
            seen(history, after, action)
        for _ in range(8):
            seen(history, there)
            seen(history, here, 0)


def test_where_nothing_can_be_grown_a_latch_tells_places_apart_or_is_looked_at() -> (
    None
):
    """What is not known of it is another place, from which looking promises more."""
    body = WALK.grow(Context(-1, (0,), reset=2))  # "here until there"
    latch, history, rng = (
        body.first_grown,
        History(NAMES, 1024),
        np.random.default_rng(0),
    )
    here, there, fork, goal = [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1]

    def show(own: list[int], action: int, believed: bool | None) -> None:
        bits, sure = np.zeros(NAMES, np.bool_), np.ones(NAMES, np.bool_)
        bits[: len(own)], bits[latch] = own, bool(believed)
        bits[[len(own) + action] if action >= 0 else []] = True
        sure[latch] = believed is not None
        history.record(bits, sure, action < 0)

    for _ in range(100):  # to the right is the cue, or the goal if it was seen
        hidden, looks, tries = bool(rng.integers(2)), *rng.integers(2, size=2)
        show(fork, -1, None)
        if looks:
            show(here if hidden else there, 1, hidden)
            show(fork, 0, hidden)
        if looks and not hidden:
            show(goal if tries else fork, int(tries), hidden)
        else:
            show(goal if looks else fork, 0, hidden if looks else None)
    told = history, np.zeros(2 * NAMES, np.bool_), np.zeros(3, np.bool_)
    state = told[1]
    state[:6] = complete(np.array(fork, np.bool_))
    found = answered(plan_by_chance(body, [4], {}, *told), history.answer)
    assert found is not None
    for believed, action in ({2 * latch}, 0), ({2 * latch + 1}, 1), (set(), 1):
        now = state.copy()
        now[list(believed)] = True
        assert found.goes_on(now, history.tick)
        assert found.step(now)[0] == action
        assert found.values[found._at(now)] > 0.99


def test_what_was_tried_in_vain_in_this_trajectory_is_not_tried_again() -> None:
    """What is hidden lasts as long as a trajectory; the next may be another."""
    history, rng = History(NAMES, 4096), np.random.default_rng(1)
    fork, dark, long, goal = [1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]
    for _ in range(200):  # to the left is the goal at times, to the right a long way
        opens = rng.random() < 0.5
        seen(history, dark)
        seen(history, fork, 0)
        for _ in range(0 if opens else rng.integers(1, 4)):
            seen(history, dark, 0)
            seen(history, fork, 0)
        for _ in range(0 if opens else 14):
            seen(history, long, 1)
        seen(history, goal, 0 if opens else 1)
    seen(history, dark)
    seen(history, fork, 0)
    bits = np.zeros(NAMES, np.bool_)
    bits[[0, 3]] = True
    told = history, complete(bits), np.zeros(3, np.bool_)
    for tried in range(3):
        found = answered(plan_by_chance(FULL, [4], {}, *told), history.answer)
        assert found is not None
        assert found.step(told[1])[0] == min(tried, 1)
        seen(history, dark, 0)
        seen(history, fork, 0)
