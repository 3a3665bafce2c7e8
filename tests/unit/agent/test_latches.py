"""Sensors that stay on once something was read, until something else is."""

import re
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.grower import Grower, _Candidate
from neurosnap.agent.growth import Growth
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.reading_history import History, latch
from neurosnap.sensorium import Sensorium, selection

PLAIN = Body.full(["cue", "start", "end"], ["go"], room=3)
FIRST, GO = PLAIN.first_grown, 2 * PLAIN.sensors.index("go&cue")
BODY = PLAIN.grow(Context(-1, (0,), reset=2)).grow(Context(-1, (GO,), reset=2 * FIRST))
ONE = st.sampled_from((True, False, None))
STEPS = st.lists(
    st.tuples(st.tuples(ONE, ONE, ONE), st.integers(-1, 0)), min_size=1, max_size=90
)


@given(STEPS)
def test_it_reads_what_its_past_readings_tell(
    steps: list[tuple[tuple[bool | None, ...], int]],
) -> None:
    senses, history = Senses(BODY), History(len(BODY.sensors), 64)
    state, told = None, list[bool | None]()
    kept: bool | None = None
    for read, action in steps:
        own = np.array([one is True for one in read])
        known = np.array([one is not None for one in read])
        begins = state is None or action < 0
        seen, sure = senses.observe(own, known, action, state, begins)
        history.record(seen, sure, begins)
        state = selection(seen, sure)
        cue, start = read[:2]
        before = None if begins else kept
        # Three values: what is unknown may be either.
        may = {
            given_cue or (was and not ends)
            for given_cue in ((cue,) if cue is not None else (True, False))
            for ends in ((start,) if start is not None else (True, False))
            for was in ((before,) if before is not None else (True, False))
        }
        kept = may.pop() if len(may) == 1 else None
        told.append(kept)
        assert (seen[FIRST] if sure is None or sure[FIRST] else None) == kept
    for number, context in enumerate(BODY.grown, FIRST):
        (a,), reset = context.literals, context.reset
        read_ = {b: history.ticks_of(b) for b in (a, a ^ 1, reset, reset ^ 1)}
        rings = latch(read_, a, reset, history.begun, history.tick)
        if len(steps) <= 64:  # else what was before it came round is not known
            assert np.array_equal(
                rings, (history.on[:, number], history.off[:, number])
            )


def test_it_is_called_by_what_switches_it_and_its_places_are_told_apart() -> None:
    assert BODY.sensors[FIRST : FIRST + 2] == (
        "cue until start",
        "go&cue until cue until start",
    )
    assert [number for _, number in BODY.latches] == [FIRST, FIRST + 1]
    assert BODY.looked_at[2 * FIRST : 2 * FIRST + 4].all()
    assert BODY.reading(BODY.grown[0], np.ones(2 * len(BODY.sensors), np.bool_)) is None
    looking = BODY.grow(Context(0, (1, 2 * FIRST + 1)))  # that it was off tells, too
    assert looking.sensors[FIRST + 2] == "go&~cue&(~cue until start)"
    with pytest.raises(InvalidValueError, match="must not be looked back at"):
        looking.retire(0)
    assert not BODY.grown[0].includes(Context(-1, (0,), reset=4))


@pytest.mark.parametrize(
    "context",
    [
        Context(-1, (0,), reset=0),
        Context(-1, (0, 2), reset=4),
        Context(-1, (0,), reset=2 * FIRST),
        Context(0, (0,), reset=2),
        Context(-1, (0,), since=1, reset=2),
    ],
)
def test_what_is_no_latch_is_refused(context: Context) -> None:
    rule = (
        "grown: must be a latch of two literals of earlier sensors, without an action"
    )
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        PLAIN.grow(context)


def test_an_imagined_state_has_what_a_latch_is_sure_to_be() -> None:
    def carried(before: str, *literals: int) -> str:
        state, last = np.zeros((2, 2 * len(BODY.sensors)), np.bool_)
        state[list(literals)] = True
        last[2 * FIRST : 2 * FIRST + 2] = before == "on", before == "off"
        on, off = BODY.carried(last, state)[2 * FIRST : 2 * FIRST + 2]
        return "on" if on else "off" if off else "?"

    assert carried("?", 0) == "on"
    assert carried("on", 3) == "on"
    assert carried("on", 1) == "?"  # nothing is said of its reset
    assert carried("off", 1) == "off"
    assert carried("on", 1, 2) == "off"
    assert carried("off", 3) == "?"  # nor of its literal


def test_of_a_large_room_some_places_are_kept_for_latches() -> None:
    """Where no context can be grown they stay: they tell places apart by themselves."""
    body = Body.full(["a", "b", "c", "d"], ["go", "stay"], room=40)
    several = [
        Context(action, (2 * i + off, 2 * j + other))
        for action, off, other in product(range(2), repeat=3)
        for i, j in combinations(range(4), 2)
    ]
    while body.has_room:
        body = body.grow(several[len(body.grown)])
    assert len(body.grown) == 39
    grower, kept = Grower(body), Context(-1, (0,), reset=2)
    grower._ready.append(_Candidate(*several[39][:2], result=6))
    assert grower.birth() is None
    grower._latch = kept
    assert grower.birth() == kept
    full = body.grow(kept)
    grower.fit(full)
    grower._latch = Context(-1, (4,), reset=6)
    assert grower.birth() is None
    small = Body.full(["a", "b"], ["go"], room=2).grow(kept)
    for has, retires in (full, -1), (small, small.first_grown):
        growth = Growth(has)
        growth.history.tick = 8 * (len(has.grown) - 1)  # its turn
        graph = EmpiricalSnapshot(Sensorium(has.sensors)).poc_graph()
        answered(growth._retire(graph), growth.history.answer)
        assert growth.changes.get("retires", -1) == retires
