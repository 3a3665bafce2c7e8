"""Plans where chance decides, held against tables that are counted and solved apart."""

from collections.abc import Mapping, Sequence
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.chances import DISCOUNT, PATIENCE, SURE, plan_by_chance
from neurosnap.agent.clones import walk_in
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.moves import (
    HIDDEN,
    SELDOM,
    Moves,
    hidden,
    moves_in,
    telling,
    told_before,
    told_by,
)
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


def test_moves_are_what_was_read_before_and_after_one_action() -> None:
    history = History(NAMES, 64)
    told = list[tuple[list[int], int, list[int]]]()
    rng, before = np.random.default_rng(0), [0, 0, 0]
    seen(history, before)
    sure = [True]
    for _ in range(100):  # it comes round: the oldest are gone
        after, action = rng.integers(2, size=3).tolist(), int(rng.integers(-1, 2))
        known = bool(rng.random() < 0.8)
        seen(history, after, action, known)
        told.append((before, action, after))
        before = after
        sure.append(known)
    lost = len(told) + 1 - 64  # moves of which what was read before is gone
    wanted = [
        move
        for move, *known in zip(
            told[lost:], sure[lost:-1], sure[lost + 1 :], strict=True
        )
        if move[1] >= 0 and all(known)
    ]
    read = {a: history.ticks_of(a) for a in range(2 * NAMES)}
    found = moves_in(walk_in(read, range(3), [6, 8], history.tick))
    assert len(wanted) > 10
    rows = zip(
        found.before.astype(int).tolist(),
        found.action.tolist(),
        found.after.astype(int).tolist(),
        strict=True,
    )
    assert list(rows) == wanted


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


def test_a_coin_tells_no_place_from_another_and_a_slip_does() -> None:
    rng, size = np.random.default_rng(3), 2000
    before = rng.integers(2, size=(size, 3)).astype(np.bool_)
    after = rng.integers(2, size=(size, 3)).astype(np.bool_)
    slips = rng.random(size) < 0.2
    after[:, 0] = before[:, 0] ^ slips  # stays mostly; the others are coins
    moves = Moves(before, rng.integers(2, size=size), after, np.arange(size))
    assert telling(moves, 2).tolist() == [True, False, False]
    after[:, 2] = before[:, 1]  # what is no coin, though it tells nothing further
    assert telling(moves, 2).tolist() == [True, True, True]


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


def test_coins_are_rarely_taken_for_more() -> None:
    rng, taken = np.random.default_rng(4), 0
    for _ in range(200):
        before, after = rng.integers(2, size=(2, 500, 4)).astype(np.bool_)
        moves = Moves(before, rng.integers(2, size=500), after, np.arange(500))
        taken += bool(telling(moves, 2).any())
    assert taken <= 6  # of 200; two are expected at most


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


def test_what_the_move_before_tells_is_told_from_chance() -> None:
    rng, size = np.random.default_rng(5), 3000
    ticks = np.arange(size)
    coin = rng.integers(2, size=size)
    pairs = rng.integers(3, size=size)
    assert abs(told_before(pairs, coin, ticks)[0]) < 0.03
    told = np.roll(pairs, 1) % 2  # the move before tells all
    of_open, of_all = told_before(pairs, told, ticks)
    assert of_open == 1
    assert of_all == pytest.approx(4 / 9, abs=0.02)  # of 1/3 and 2/3
    half = np.where(rng.random(size) < 0.5, coin, told)
    assert 0.15 < told_before(pairs, half, ticks)[0] < 0.35
    # None comes right after another; or nothing is left open.
    assert told_before(pairs, told, 2 * ticks) == (0, 0)
    assert told_before(pairs, pairs, ticks) == (0, 0)


def test_what_hardly_ever_matters_hides_nothing() -> None:
    ticks = np.arange(3000)
    for every, hides in (100, False), (10, True):
        pairs = np.random.default_rng(1).integers(2, size=len(ticks))
        open_ = ticks % every == 0  # where only the move before tells
        led = np.where(open_, np.roll(pairs, 1), pairs)
        pairs[open_] = 2
        of_open, of_all = told_before(pairs, led, ticks)
        assert of_open == pytest.approx(1)
        assert of_all == pytest.approx(0.5 / every, rel=0.2)
        assert hidden(pairs, led, ticks) == hides


def test_what_is_mostly_left_to_chance_is_not_hidden() -> None:
    rng, ticks = np.random.default_rng(2), np.arange(3000)
    pairs, coin = rng.integers(3, size=3000), rng.integers(2, size=3000)
    led = np.where(rng.random(3000) < 0.26, np.roll(pairs, 1) % 2, coin)
    of_open, of_all = told_before(pairs, led, ticks)
    assert of_all > SELDOM
    assert of_open < HIDDEN
    assert not hidden(pairs, led, ticks)


@example(  # what one sensor reads always after one pair tells nothing of it
    list(
        zip(
            [0, 0, 1, 1, 0, 0, 0, 1],
            [0, 1, 0, 0, 0, 1, 1, 1],
            [3, 0, 2, 3, 3, 1, 2, 2],
            strict=True,
        )
    )
)
@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 2), st.integers(0, 7)),
        min_size=1,
        max_size=14,
    )
)
def test_the_sensor_that_tells_most_is_the_one_of_all(
    moved: list[tuple[int, int, int]],
) -> None:
    """Held against all ways to choose as many moves as a sensor was on at."""
    pairs, led, codes = np.array(moved).T

    def purity(mine: NDArray[np.intp]) -> float:
        counts = np.bincount(led[mine])
        return float((counts**2).sum() / len(mine)) if len(mine) else 0.0

    def parted(whole: NDArray[np.intp], on: NDArray[np.intp]) -> float:
        return purity(on) + purity(np.setdiff1d(whole, on))

    gains, left = np.zeros(3), 0.0
    for pair in set(pairs.tolist()):
        whole = np.flatnonzero(pairs == pair)
        if len(set(led[whole].tolist())) == 1:
            continue
        for sensor in range(3):
            on = whole[codes[whole] >> sensor & 1 == 1]
            ways = combinations(whole.tolist(), len(on))
            by_accident = np.mean([parted(whole, np.array(w, np.intp)) for w in ways])
            gains[sensor] += parted(whole, on) - by_accident
        one = [parted(whole, whole[[k]]) for k in range(len(whole))]
        left += len(whole) - float(np.mean(one))
    readings = codes[:, None] >> np.arange(3) & 1 == 1
    found = told_by(pairs, led, readings)
    enough = gains.max() - HIDDEN * left
    if found is not None:
        assert gains[found] == pytest.approx(gains.max())
        assert enough > -1e-9
    elif left:
        assert enough < 1e-9


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
