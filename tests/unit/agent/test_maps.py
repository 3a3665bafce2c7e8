"""Clones are sensors: what each reads is told by what all of its map read before."""

import re
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.clones import Walk
from neurosnap.agent.growth import Growth
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.map_grower import MapGrower
from neurosnap.agent.planner import target_literals
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.history_questions import Answer, Question, answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import selection

PLAIN = Body.full(["red", "dark"], ["go", "stay"], room=6)
FIRST = PLAIN.first_grown
RED, BLUE = (0, 3), (1, 3)
AMONG = FIRST, 3


def clone(look: tuple[int, ...], *ways: int, among: tuple[int, ...] = AMONG) -> Context:
    return Context(-1, look, ways=ways, among=among)


# go: 1 -> 2 -> 3 -> 1; stay: 1 and 2 stay, what it does at 3 is not known.
CLONES = (
    clone(RED, 0, FIRST + 2, 1, FIRST),
    clone(RED, 0, FIRST, 1, FIRST + 1),
    clone(BLUE, 0, FIRST + 1),
)
BODY = PLAIN.grow(CLONES[0]).grow(CLONES[1]).grow(CLONES[2])
LEADS = {(0, 0): 1, (0, 1): 2, (0, 2): 0, (1, 0): 0, (1, 1): 1}
LOOKS = (True, True, False)
ONE = st.sampled_from((True, False, None))
STEPS = st.lists(st.tuples(ONE, ONE, st.integers(-1, 1)), min_size=1, max_size=40)


@given(STEPS)
def test_a_clone_is_off_where_it_cannot_be_and_on_where_it_must(
    steps: list[tuple[bool | None, bool | None, int]],
) -> None:
    senses, state = Senses(BODY), None
    may = {0, 1, 2}
    for red, dark, action in steps:
        own = np.array([red is True, dark is True])
        known = np.array([red is not None, dark is not None])
        begins = state is None or action < 0
        seen, sure = senses.observe(own, known, action, state, begins)
        state = selection(seen, sure)
        here = {k for k in range(3) if red in (LOOKS[k], None) and dark is not True}
        led = {LEADS.get((action, k)) for k in may}
        anywhere = begins or None in led
        may = (here if anywhere else here & led) or here
        for k in range(3):
            on, off = state[2 * (FIRST + k) : 2 * (FIRST + k) + 2]
            assert off == (k not in may)
            assert on == (may == {k})


def test_an_imagined_state_has_where_one_comes_to_and_what_is_to_be_read_there() -> (
    None
):
    go = 2 * BODY.sensors.index("go")
    before, state = np.zeros((2, 2 * len(BODY.sensors)), np.bool_)
    before[[2 * FIRST + 1, 2 * FIRST + 2, 2 * FIRST + 5]] = True  # at the second
    state[go] = True
    told = BODY.carried(before, state)
    assert told[2 * FIRST : 2 * FIRST + 6].tolist() == [0, 1, 0, 1, 1, 0]
    assert told[:4].tolist() == [0, 1, 0, 1]  # neither red nor dark
    before[:] = False  # it may be anywhere
    assert BODY.carried(before, state)[:4].tolist() == [0, 0, 0, 1]
    state[0] = True
    assert BODY.carried(before, state)[2 * FIRST : 2 * FIRST + 6].tolist() == [
        *(0, 0, 0, 0, 0, 1)
    ]


def test_clones_are_called_by_what_is_seen_there_and_can_be_aimed_at() -> None:
    names = "red@1", "red@2", "@3"
    assert BODY.sensors[FIRST : FIRST + 3] == names
    assert BODY.carries == (FIRST, FIRST + 1, FIRST + 2)
    assert BODY.looked_at[2 * FIRST : 2 * FIRST + 6].all()
    assert not BODY.looked_at[2 * FIRST + 6 :].any()
    assert target_literals(BODY, ["@3", "dark*"]) == (3, 2 * FIRST + 4)
    with pytest.raises(InvalidValueError):
        target_literals(PLAIN, ["@3"])
    partly = PLAIN.grow(CLONES[0]).grow(CLONES[1])
    assert not partly.maps
    assert not partly.carries  # not before all are there
    assert BODY.retire(1).carries == ()
    full = np.ones(2 * len(BODY.sensors), np.bool_)
    assert BODY.reading(CLONES[0], full) is None
    [one] = BODY.maps
    assert one.leading(0, 0) == [FIRST, FIRST + 2]  # to red
    assert one.leading(0, 1) == [FIRST + 1]
    assert one.leading(1, 1) == []


@pytest.mark.parametrize(
    ("before", "context", "rule"),
    [
        ((), clone(RED, among=(FIRST + 1, 3)), "the next of its map"),
        ((), clone(RED, among=(FIRST - 1, 3)), "the next of its map"),
        ((), clone(RED, among=(FIRST, 7)), "the next of its map"),
        ((), clone(RED, among=(FIRST,)), "the next of its map"),
        (CLONES[:1], clone(RED, among=(FIRST, 2)), "the next of its map"),
        ((), clone(()), "of own literals"),
        ((), clone((3, 0)), "of own literals"),
        ((), clone((0, 2 * FIRST)), "of own literals"),
        (CLONES[:1], clone((0,)), "of the same sensors"),
        ((), clone(RED, 0), "must be led to"),
        ((), clone(RED, 2, FIRST), "must be led to"),
        ((), clone(RED, 0, FIRST + 3), "must be led to"),
        (CLONES[:1], clone(RED, 0, FIRST + 2), "by each from each to but one"),
        ((), CLONES[0]._replace(action=0), "without an action"),
        ((), CLONES[0]._replace(reset=2), "without an action"),
    ],
)
def test_what_is_no_clone_is_refused(
    before: tuple[Context, ...], context: Context, rule: str
) -> None:
    body = PLAIN
    for each in before:
        body = body.grow(each)
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        body.grow(context)
    with pytest.raises(InvalidValueError):
        Body(own=("red", "dark"), room=6).grow(context)


class Walker:
    """A walk on a ring of five places, one of them lit, that grows what is due."""

    def __init__(self, room: int = 8, coins: tuple[bool, bool] = (False, True)) -> None:
        self.body = Body.full(["lit", "coin"], ["left", "right"], room=room)
        self.history = History(len(self.body.sensors), 1024)
        self.grower = MapGrower(self.body)
        self.random = np.random.default_rng(1)
        self.coins = np.array(coins)
        self.place, self.births = 0, dict[int, Context]()
        self.asked = set[int]()  # the ticks at which past readings were asked for

    def answer(self, question: Question) -> Answer:
        self.asked.add(self.history.tick)
        return self.history.answer(question)

    def go(
        self,
        ticks: int,
        unexplained: int = 1,
        lit: tuple[int, ...] = (0,),
        avoided: tuple[int, int] = (-1, -1),
        chance: bool = False,
    ) -> None:
        for _ in range(ticks):
            action = int(self.random.integers(2))
            if (self.place, action) == avoided:
                action = 1 - action
            self.place = (self.place + 2 * action - 1) % 5
            bits = np.zeros(len(self.body.sensors), np.bool_)
            coin = self.random.random() < 0.5
            bits[[0, 2 + action]] = coin if chance else self.place in lit, True
            bits[1] = self.random.random() < 0.5
            self.history.record(bits)
            due = self.grower.find(self.history, unexplained, self.coins)
            if (found := answered(due, self.answer)) is not None:
                rings = self.grower.readings(found, self.history)
                on, off = answered(rings, self.history.answer)
                assert not (on & off).any()
                self.births[self.history.tick] = found
                self.body = self.body.grow(found)
                self.grower.fit(self.body)


@pytest.mark.parametrize("coins", [(False, True), (True, True)])
def test_what_chance_decides_makes_no_look_and_what_tells_does(
    coins: tuple[bool, bool],
) -> None:
    walk = Walker(coins=coins)
    walk.go(700)
    assert {each.literals for each in walk.births.values()} == {(0,), (1,)}


def test_where_a_way_was_never_tried_it_is_waited_for() -> None:
    walk = Walker()
    walk.go(500, avoided=(2, 0))
    assert not walk.births
    walk.go(600)
    assert len(walk.body.maps) == 1


def test_a_search_that_chance_defeats_ends_at_once() -> None:
    walk = Walker()
    walk.go(600, chance=True)
    assert walk.asked == {256, 512}


def test_the_clones_of_a_map_retire_once_another_takes_its_place() -> None:
    def again(context: Context) -> Context:
        ways = [k + 3 * (place % 2) for place, k in enumerate(context.ways)]
        return context._replace(ways=tuple(ways), among=(FIRST + 3, 3))

    body, graph = BODY, PocGraph(np.eye(2 * len(BODY.sensors), dtype=np.bool_))
    for context in CLONES:
        body = body.grow(again(context))
    for known, retiring in ((BODY, set[int]()), (body, {FIRST, FIRST + 1, FIRST + 2})):
        growth, retired = Growth(known), set[int]()
        for turn in range(len(known.grown)):
            growth.history.tick, growth.changes = 8 * turn, {}
            answered(growth._retire(graph), growth.history.answer)
            retired.update(growth.changes.values())
        assert retired == retiring


def test_a_map_is_looked_for_where_surprises_remain_and_tried_before_it_is_grown() -> (
    None
):
    walk = Walker()
    walk.go(256, unexplained=0)
    walk.go(200)
    assert not walk.births
    walk.go(120)
    # Found at tick 512, believed 50 ticks later, and then one a tick.
    assert list(walk.births) == list(range(562, 567))
    assert len(walk.body.maps) == 1
    restored = Walker()
    restored.grower.restore(walk.grower.arrays())
    assert (
        restored.grower.arrays()["map"].tolist() == walk.grower.arrays()["map"].tolist()
    )


def test_a_map_that_later_readings_contradict_or_that_has_no_room_is_not_grown() -> (
    None
):
    walk = Walker()
    walk.go(256)
    walk.go(200, lit=(2, 3))
    assert not walk.births
    narrow = Walker(room=4)
    narrow.go(400)
    assert not narrow.births


def test_a_map_that_still_goes_with_all_is_not_looked_for_again() -> None:
    walk = Walker(room=12)
    walk.go(1100)
    assert list(walk.births) == list(range(306, 311))
    walk.go(3100, lit=(0, 2))  # another light: a whole history later it is found
    assert len(walk.body.maps) == 2
    assert {each.among for each in walk.births.values()} == {
        (walk.body.first_grown, 5),
        (walk.body.first_grown + 5, 5),
    }


@pytest.mark.parametrize(
    "text",
    [
        b"{}x",
        b'{"looks": [[true]], "sensors": []}',
        b'{"looks": [[true]], "sensors": [0], "leads": [[0]]}',
        b'{"looks": [[true]], "sensors": [0], "leads": [[0], [1]]}',
        b'{"looks": [[true]], "sensors": [0], "leads": [[0], []]}',
        b'{"looks": [[true]], "sensors": [2], "leads": [[0], [0]]}',
        b'{"looks": [[true]], "sensors": [0], "leads": [[0], [0]], "first": 99}',
        b'{"first": 3}',
    ],
)
def test_a_restored_one_must_make_sense(text: bytes) -> None:
    with pytest.raises(ValueError, match="map: "):
        Walker().grower.restore({"map": np.frombuffer(text, np.uint8)})


def test_following_a_map_agrees_with_carrying_it() -> None:
    """Walk readings give a newborn clone what it would have read."""
    random, senses, state = np.random.default_rng(0), Senses(BODY), None
    read, actions, told = [], [], []
    place = 0
    for _tick in count():
        action = int(random.integers(2)) if place < 2 else 0
        if state is not None:
            place = LEADS[action, place]
        own = np.array([LOOKS[place], False])
        seen, sure = senses.observe(own, None, action, state, state is None)
        actions.append(-1 if state is None else action)
        state = selection(seen, sure)
        read.append(own)
        told.append(~state[2 * FIRST + 1 : 2 * FIRST + 6 : 2])
        if len(read) == 30:
            break
    on = np.array(read)
    past = Walk(on, ~on, np.array(actions, np.int64))
    assert np.array_equal(BODY.maps[0].map.follow(past)[0], told)
