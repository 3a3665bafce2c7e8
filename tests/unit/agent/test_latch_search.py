"""The search for latches, held against one that goes through the ticks one by one."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.latch_search import ACCIDENT, find_latch
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.reading_history import History

OWN, SENSORS = 3, 5  # two cues and what follows; then an action, and a context
HIT, GO = 2 * 2, 2 * 3
Ticks = list[tuple[list[bool], bool]]


def lived(
    seed: int,
    seen: float,
    wrong: float,
    length: int,
    once: bool = False,
    size: int = 500,
) -> Ticks:
    """Return readings, and where trajectories begin: a hidden thing lasts for one.

    A cue is read now and then, and after `go` what follows is told by what is hidden.
    If it is done once, a trajectory ends with it.
    """
    rng, ticks = np.random.default_rng(seed), Ticks()
    while len(ticks) < size:
        hidden = rng.random() < 0.5
        steps = rng.integers(2, length + 1)
        for step in range(steps):
            cues = [bool(hidden == so and rng.random() < seen) for so in (True, False)]
            cues = [cue != (rng.random() < wrong) for cue in cues]
            go = step == steps - 1 if once else bool(step and rng.random() < 0.5)
            hit = go and bool(hidden)
            ticks.append(([*cues, hit, go, bool(rng.random() < 0.3)], not step))
    return ticks


def found_in(ticks: Ticks, there_are: list[Context]) -> Context | None:
    history = History(SENSORS, 512)
    for read, begins in ticks:
        history.record(np.array(read), None, begins)
    past = history.tick, history.begun, there_are
    return answered(find_latch([GO], HIT, SENSORS, OWN, *past), history.answer)


def by_hand(ticks: Ticks, there_are: list[Context]) -> Context | None:
    told = [([k for on in read for k in (on, not on)], new) for read, new in ticks]
    for latch in there_are:
        both = latch.literals[0], latch.reset
        for a, b in both, both[::-1]:
            counts = occasions(told, a, b)
            if counts is not None and no_accident(counts, 2):
                return None
    every = [*range(2 * OWN), *range(2 * OWN, 2 * SENSORS, 2)]
    for some in every[: 2 * OWN], every:
        best, most = None, (0, 0)
        for a in some:
            for b in some:
                pair = Context(-1, (a,), reset=b)
                counts = occasions(told, a, b) if a != b else None
                if counts is None or (min(counts), sum(counts)) <= most:
                    continue
                if no_accident(counts, len(some)):
                    best, most = pair, (min(counts), sum(counts))
        if best is not None:
            return best
    return None


def no_accident(counts: tuple[int, int], literals: int) -> bool:
    return ACCIDENT * math.comb(sum(counts), counts[0]) > 2 * literals**2


def occasions(ticks: Ticks, a: int, b: int) -> tuple[int, int] | None:
    """Return on how many occasions it told what came, and what failed.

    None if it was right at one time and wrong at another.
    """
    value: bool | None = None
    number, outcome = 0, None
    told: dict[bool, set[int]] = {True: set(), False: set()}
    agreed = set()
    for literals, begins in ticks:
        if begins:
            value, outcome = None, None
        came = bool(literals[HIT])
        if literals[GO]:
            number += outcome is not came
            outcome = came
            if value is not None:
                told[came].add(number)
                agreed.add(value == came)
        # The one that is read later counts; if both are, the first.
        value = True if literals[a] else False if literals[b] else value
    return None if len(agreed) > 1 else (len(told[True]), len(told[False]))


@given(
    st.integers(0, 10**6),
    st.sampled_from((0.05, 0.2, 0.7)),
    st.sampled_from((0.0, 0.0, 0.005)),
    st.sampled_from((3, 8)),
    st.booleans(),
)
def test_it_is_never_wrong_and_tells_on_the_most_occasions(
    seed: int, seen: float, wrong: float, length: int, once: bool
) -> None:
    ticks = lived(seed, seen, wrong, length, once, size=200)
    first = found_in(ticks, [])
    assert first == by_hand(ticks, [])
    for there in Context(-1, (0,), reset=2), Context(-1, (HIT,), reset=5):
        assert found_in(ticks, [there]) == by_hand(ticks, [there])


def test_one_that_is_seldom_known_is_found() -> None:
    """What was not looked at is not known, and the next time it may be."""
    found = found_in(lived(1, 0.2, 0.0, 8, once=True), [])
    assert found == Context(-1, (0,), reset=2)
    of_a_grown_one = Context(-1, (0,), reset=2 * SENSORS)
    assert found_in(lived(1, 0.2, 0.0, 8, once=True), [of_a_grown_one]) == found
    # It would be wrong at times.
    assert found_in(lived(1, 0.2, 0.05, 8, once=True), []) is None


def test_what_lasts_in_a_trajectory_is_one_occasion() -> None:
    """Many times in few trajectories tell no more than these do."""
    ticks = lived(3, 0.2, 0.0, 120)
    assert sum(read[3] for read, _ in ticks) > 100
    assert found_in(ticks, []) is None
