"""Windows of the last ticks, as sensors that are grown without an action."""

import re
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.check_grown import OLDEST
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.policy import EXACT
from neurosnap.agent.window_grower import _follows, _search_at
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.lags import find_lags
from neurosnap.poc.learning.premises import find_exclusions
from neurosnap.poc.learning.reading_history import History, window
from neurosnap.poc.order.graph import PocGraph
from neurosnap.wire import HISTORY
from tests.support.watching import Watching

Bits = NDArray[np.bool_]
OWN = ("a", "b", "c")
READINGS = (True, False, None)


@st.composite
def windows(draw: st.DrawFn) -> Context:
    since = draw(st.sampled_from([0, 1, 2, 5, OLDEST]))
    least = 1 if since else 2
    sensors = draw(st.sets(st.integers(0, 2), min_size=least, max_size=3))
    literals = tuple(2 * k + draw(st.integers(0, 1)) for k in sorted(sensors))
    return Context(-1, literals, since, draw(st.integers(0, since)))


def read(
    rows: Sequence[Sequence[bool | None]], first: int, one: Context
) -> bool | None:
    """Return what a window reads at the last of the rows; the first begins it all."""
    ticks = range(len(rows) - 1 - one.since, len(rows) - one.until)
    seen = [
        None if at < first or rows[at][a >> 1] is None else rows[at][a >> 1] != a % 2
        for at in ticks
        for a in one.literals
    ]
    return False if False in seen else None if None in seen else True


@pytest.mark.slow
@given(
    st.lists(windows(), min_size=1, max_size=4, unique=True),
    st.integers(0, 2**32 - 1),
    st.integers(0, 149),
)
def test_they_read_what_the_definition_has_and_so_do_their_rings(
    chosen: list[Context], seed: int, joined: int
) -> None:
    rng, body = np.random.default_rng(seed), Body(own=OWN, room=5)
    kept = History(len(OWN), 128)  # the first ticks are forgotten
    senses, other, first = Senses(body), Senses(body), 0
    for one in chosen:
        body = body.grow(one)
    body = body.retire(0) if seed % 2 else body
    senses.fit(body)
    rows: list[list[bool | None]] = []
    rarely = rng.choice([0.02, 0.3])
    for at in range(150):
        if at == joined:  # one that has only the history goes on alike
            other = Senses(body, history=kept)
        changes = rng.random(len(OWN)) < rarely
        last = rows[-1] if rows else [False] * len(OWN)
        drawn = [READINGS[k] for k in rng.integers(0, 3, len(OWN)).tolist()]
        row = [
            new if c else old for c, new, old in zip(changes, drawn, last, strict=True)
        ]
        row[0] = True if row == [None] * len(OWN) else row[0]
        rows.append(row)
        begins = bool(rng.random() < 0.02)
        first = at if begins else first
        bits = np.array([on is True for on in row])
        known = None if None not in row else np.array([on is not None for on in row])
        seen, told = senses.observe(bits, known, begins=begins)
        told = np.ones(body.count, np.bool_) if told is None else told
        for place, one in enumerate(body.grown):
            expected = None if place in body.retired else read(rows, first, one)
            sensor = body.first_grown + place
            assert (seen[sensor], told[sensor]) == (
                expected is True,
                expected is not None,
            )
        assert not told[body.size :].any()
        if at >= joined:
            again = other.observe(bits, known, begins=begins)
            assert (again[0] == seen).all()
            assert again[1] is not None
            assert (again[1] == told).all()
        kept.record(bits, known, begins)
    rings = {a: kept.ticks_of(a) for a in range(2 * len(OWN))}
    oldest = len(rows) - kept.length
    for one in chosen:
        span = one.since, one.until
        on, off = window(rings, one.literals, span, kept.begun, kept.tick)
        assert read(rows, max(first, oldest), one) == last_of(on, off, kept.tick)


def last_of(on: NDArray[np.uint64], off: NDArray[np.uint64], ticks: int) -> bool | None:
    word, bit = divmod((ticks - 1) % (64 * len(on)), 64)
    yes, no = (int(ring[word]) >> bit & 1 for ring in (on, off))
    return True if yes else False if no else None


@pytest.mark.parametrize(
    ("context", "rule"),
    [
        ((-1, (0,)), "must be of own literals, ascending, of no action, several or of"),
        ((-1, (0, 1)), "must be of own literals, ascending, of no action"),
        ((-1, (0, 6)), "must be of own literals, ascending, of no action"),
        ((0, (0, 2)), "must be of own literals, ascending, of no action"),
        ((-1, (0,), 64), "must begin up to 63 ticks ago, and not end before it"),
        ((-1, (0,), 2, 3), "must begin up to 63 ticks ago, and not end before it"),
    ],
)
def test_what_is_no_window_is_refused(context: tuple[int, ...], rule: str) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(f"grown: {rule}")):
        Body(own=OWN, room=1).grow(Context(*context))  # type: ignore[arg-type]


def test_their_names_say_what_they_are() -> None:
    body = Body(own=("a", "b", "a&~b"), room=5)
    for context in (
        Context(-1, (0, 3)),
        Context(-1, (1,), 1),
        Context(-1, (0,), 4, 4),
        Context(-1, (0, 2), 4, 2),
    ):
        body = body.grow(context)
    assert body.sensors[3:] == (
        "a&~b#2",  # a sensor of the world has that name
        "~a for 1 tick",
        "a 4 ticks ago",
        "a&b 4 to 2 ticks ago",
        "grown 5",
    )


# Which windows are grown -------------------------------------------------------------


def held(rng: np.random.Generator, ticks: int, sensors: int) -> Bits:
    """Return independent sensors that are held for some ticks."""
    turns = rng.random((ticks, sensors)) < 0.15
    on: Bits = (turns.cumsum(axis=0) + rng.integers(0, 2, sensors)) % 2 == 1
    return on


def plant(rows: Bits, rng: np.random.Generator) -> None:
    """Let the last three sensors follow from others: at once, and late, and after."""
    ticks = len(rows)
    rows[:, -1] = (rows[:, 0] & rows[:, 1]) | (rng.random(ticks) < 0.2)
    waits = 0
    for at in range(ticks):  # it comes on up to four ticks after s2, goes off with it
        waits = waits - 1 if rows[at, 2] else int(rng.integers(0, 5))
        rows[at, -2] = rows[at, 2] and waits < 0


@pytest.mark.slow
def test_what_relates_the_readings_is_grown_and_implies_it() -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 2100, 9)
    plant(rows, rng)
    watching = Watching(9, 6)
    watching.show(rows)
    assert watching.grown == ["s0&s1", "s2 for 4 ticks"]
    graph, sensors = (
        watching.mind.snapshot.poc_graph(),
        watching.mind.memory.body.sensors,
    )
    for premise, conclusion in (("s0&s1", "s8"), ("s2 for 4 ticks", "s7")):
        above = graph.up([2 * sensors.index(premise)])
        assert above[2 * sensors.index(conclusion)]
    born = [one.tick for one in watching.decisions if one.born >= 0]
    # Both of one search, at two ticks, or of two.
    assert set(born) <= {at + k for at in (256, 512, 1024, 2048) for k in (0, 1)}


def test_a_wait_that_never_failed_is_told_and_not_a_shorter_one_that_did() -> None:
    rng = np.random.default_rng(2015)
    rows = held(rng, 4096, 20)
    plant(rows, rng)
    lags = [
        lag for lag in find_lags(Columns.of(rows), 32) if lag.implication == (4, 36)
    ]
    assert [(lag.throughout, lag.ticks) for lag in lags] == [(4, 4)]


def test_what_comes_within_some_ticks_is_two_windows_that_exclude_each_other() -> None:
    rng = np.random.default_rng(0)
    rows = held(rng, 2100, 4)
    rows[:, 2:] = False
    for at in np.flatnonzero(rng.random(2000) < 0.05).tolist():  # a pulse, an answer
        rows[at, 2] = rows[at + int(rng.integers(1, 5)), 3] = True
    watching = Watching(4, 4)
    watching.show(rows)
    # The pulse is answered within four ticks, and the answer comes only after one.
    assert sorted(watching.grown) == [
        "s2 4 ticks ago",
        "~s2 for 4 ticks",
        "~s3 for 4 ticks",
    ]
    graph, sensors = (
        watching.mind.snapshot.poc_graph(),
        watching.mind.memory.body.sensors,
    )
    above = graph.up([2 * sensors.index("s2 4 ticks ago")])
    assert above[2 * sensors.index("~s3 for 4 ticks") + 1]
    assert not watching.retired


@pytest.mark.slow
@pytest.mark.parametrize(("threshold", "grows"), [(EXACT, False), (0.05, True)])
def test_what_the_snapshot_would_not_believe_is_not_grown(
    threshold: float, grows: bool
) -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 2100, 9)
    plant(rows, rng)
    rows[rng.random(len(rows)) < 0.01, -1] = False
    watching = Watching(9, 6, threshold)
    watching.show(rows)
    assert ("s0&s1" in watching.grown) == grows


def test_a_copy_that_is_late_takes_one_window_that_looks_back() -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 1100, 3)
    rows[3:, 2] = rows[:-3, 1]
    watching = Watching(3, 6)
    watching.show(rows)
    assert [name for name in watching.grown if name.endswith("ago")] == [
        "s1 3 ticks ago"
    ]


def test_what_follows_from_a_shorter_window_or_a_part_is_not_grown() -> None:
    short, long = (Context(-1, (2,), since=k) for k in (2, 4))
    ago = {k: Context(-1, (5,), since=k, until=k) for k in (0, 1, 2, 4)}
    part, whole = (Context(-1, literals) for literals in ((0,), (0, 3)))
    known = {short: 8, ago[0]: 5, ago[2]: 10, part: 0, long: 12}
    sensors = 7
    at_once = PocGraph.from_implications(sensors, [(8, 4), (0, 4)])
    late = PocGraph.from_implications(sensors, [(8, 11)])
    for graph, one, other, follows in (
        (at_once, short, ago[0], True),
        (at_once, long, ago[0], True),  # what was so for longer was for a while
        (at_once, whole, ago[0], True),
        (at_once, Context(-1, (3,), since=4), ago[0], False),
        (late, short, ago[2], True),
        (late, long, ago[4], True),  # two ticks earlier that was the same
        (late, long, ago[0], False),
        (late, Context(-1, (2,), since=1), ago[1], False),
    ):
        assert _follows(one, other, known, graph) == follows


def test_searches_become_rare_and_have_a_number_each() -> None:
    found = {at: k for at in range(30_000) if (k := _search_at(at, HISTORY))}
    doubled = [64 << k for k in range(8)]
    assert [*found] == [*doubled, 12_288, 16_384, 20_480, 24_576, 28_672]
    assert [*found.values()] == [*range(1, 14)]


def test_a_small_share_of_the_accidents_asks_for_more_evidence() -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 2100, 9)
    plant(rows, rng)
    columns = Columns.of(rows)
    reach = np.eye(18, dtype=np.bool_)
    assert find_exclusions(columns, 2, reach)[0]
    assert find_lags(columns, 8)
    assert not find_exclusions(columns, 2, reach, shares=10**60)[0]
    assert not find_lags(columns, 8, shares=10**60)


@pytest.mark.slow
def test_of_independent_sensors_nothing_is_grown() -> None:
    found = []
    for seed in range(10):
        watching = Watching(7, 3)
        watching.show(held(np.random.default_rng(seed), 600, 7))
        found += watching.grown
    assert not found


@pytest.mark.slow
def test_one_that_is_needless_retires_and_room_is_not_exceeded() -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 9000, 9)
    plant(rows, rng)
    watching = Watching(9, 1)
    watching.show(rows[:600])
    assert watching.grown == ["s0&s1"]
    rows[600:, -1] = rng.random(len(rows) - 600) < 0.3  # the machine is another one
    watching.show(rows[600:])
    assert watching.grown == watching.retired == ["s0&s1"]


def test_a_memory_that_was_kept_grows_the_same() -> None:
    rng = np.random.default_rng(5)
    rows = held(rng, 1100, 9)
    plant(rows, rng)
    whole, first = Watching(9, 6), Watching(9, 6)
    whole.show(rows)
    first.show(rows[:512])  # the next birth is at 513, of the same search
    kept, second = first.mind.memory.to_bytes(), Watching(9, 6)
    second.mind.memory.restore(kept)
    second.mind.snapshot = first.mind.snapshot
    second.senses = Senses(second.mind.memory.body, None, second.mind.memory.history)
    second.show(rows[512:])
    assert second.grown == whole.grown
    assert second.decisions == whole.decisions[512:]
