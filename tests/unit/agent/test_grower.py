"""Which sensors are grown: covers of counterexamples, tested before use."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.grower import LONGEST, Grower, _Candidate
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import complete

Bits = NDArray[np.bool_]
NAMES = ("a", "b", "c", "hit")
HIT = 2 * NAMES.index("hit")


@dataclass
class Watched:
    """A grower that is shown steps one by one, and told that nothing is believed."""

    room: int = 200

    def __post_init__(self) -> None:
        self.body = Body.full(NAMES, ["go", "stay"], room=self.room)
        self.grower = Grower(self.body)
        self.history = History(len(self.body.sensors), 64)
        self.senses = Senses(self.body)
        self.births: list[Context] = []

    def show(
        self, before: str, after: str, action: int = 0, said: str = ""
    ) -> Context | None:
        """Show a step from one state to another, each as the names that are on.

        What is said is guaranteed beforehand.
        """
        state = np.zeros(2 * len(self.body.sensors), np.bool_)
        state[: 2 * len(NAMES)] = complete(bits(before))
        observation = self.senses.observe(bits(after), None, action, state)[0]
        self.history.record(observation)
        foretold = np.zeros(2 * len(NAMES), np.bool_)
        foretold[[2 * NAMES.index(name) for name in said.split()]] = True
        came = complete(observation[: len(NAMES)])
        past = self.history.tick, self.history.begun
        search = self.grower.notice(action, state, foretold, came, *past)
        answered(search, self.history.answer)
        found = self.grower.birth()
        if found is not None:
            self.births.append(found)
            self.body = self.body.grow(found)
            self.grower.fit(self.body)
        return found

    def trials(self) -> list[Context]:
        """Return the covers under trial."""
        return [one.context for many in self.grower._trials.values() for one in many]


def bits(names: str) -> Bits:
    return np.array([name in names.split() for name in NAMES])


def grown(*names: str, action: int = 0) -> Context:
    """Return a context by the names of its literals."""
    literals = (2 * NAMES.index(one.rstrip("*")) + one.endswith("*") for one in names)
    return Context(action, tuple(sorted(literals)))


BEFORE = ("", "a", "b", "a b", "c", "a c", "b c", "a b c")


def test_what_two_sensations_guarantee_together_is_grown_while_there_is_room() -> None:
    few, many = Watched(room=1), Watched()
    for watched in (few, many):
        for before in BEFORE * 30:
            on = set(before.split())
            came = "hit" if {"a", "b"} <= on else "c" if {"c", "a"} <= on else ""
            watched.show(before, came)
    assert grown("a", "b") in many.births
    # Nothing else comes of one sensation, and of what has none it takes no cover.
    assert all(len(literals) > 1 for _, literals, *_ in many.births)
    assert len(many.births) > 1
    assert few.births == many.births[:1]


@pytest.mark.parametrize("said", ["", "hit"])
def test_a_cover_is_not_born_before_it_is_confirmed_and_needed(said: str) -> None:
    watched = Watched()
    for before in BEFORE[:-1]:
        watched.show(before, "hit" if before == "a b" else "")
    found = [watched.show("a b", "hit", said=said) for _ in range(10)]
    if said:  # something else says so
        assert watched.births == []
        assert watched.show("a b", "hit") == grown("a", "b")
    else:
        assert [one is not None for one in found].index(True) >= 4
        assert grown("a", "b") in watched.births


def test_a_cover_that_fails_is_dropped_and_the_next_waits() -> None:
    watched = Watched()
    for before, after in (("a", ""), ("b", ""), ("c", ""), ("a b", "hit")):
        watched.show(before, after)
    assert set(watched.trials()) == {grown("a", "b")}
    watched.show("a b", "")
    assert not set(watched.trials())
    for _ in range(2):  # after the first failure two surprises pass
        watched.show("a b c", "hit")
        assert not set(watched.trials())
    watched.show("a b c", "hit")
    (trial,) = watched.trials()
    assert 2 * NAMES.index("c") in trial[1]


def test_what_comes_unforeseen_is_counted_until_it_is_foreseen() -> None:
    watched = Watched(room=0)  # so that nothing explains it
    shares = list[float]()
    for said in ("", "", "", "", "hit", "hit", "hit", "hit"):
        watched.show("a", "hit", said=said)
        shares.append(watched.grower.surprising[0, HIT])
    assert shares == pytest.approx([0, 0, 0, 1, 4 / 5, 4 / 6, 4 / 7, 4 / 8])
    for _ in range(40):
        watched.show("a", "hit", said="hit")
    assert watched.grower.surprising[0, HIT] == 0
    for _ in range(9):
        watched.show("a", "hit")
    assert watched.grower.surprising[0, HIT] > 0.5
    assert not watched.grower.surprising[1].any()


def test_what_a_sensor_was_born_for_is_counted_anew() -> None:
    watched, shares = Watched(), [0.0]
    while not watched.births:
        watched.show("a b", "hit")
        shares.append(watched.grower.surprising[0, HIT])
        watched.show("a", "")
        watched.show("b", "")
    assert shares[-2:] == [1, 0]


def test_a_cover_that_looks_back_at_what_retires_is_dropped() -> None:
    watched = Watched()
    body = watched.body.grow(Context(0, (0, 2)))
    watched.grower.fit(body)
    looks_back, other = (2 * body.first_grown,), (0, 4)
    watched.grower._trials[0, HIT] = [
        _Candidate(0, literals, HIT) for literals in (looks_back, other)
    ]
    watched.grower.fit(body)
    assert len(watched.trials()) == 2
    watched.grower.fit(body.retire(0))
    assert watched.trials() == [Context(0, other)]


@pytest.mark.parametrize("literals", [(0, 2), (10**6,)])
def test_a_latch_that_cannot_be_is_refused(literals: tuple[int, ...]) -> None:
    watched = Watched()
    watched.grower._latch = Context(-1, literals, reset=4)
    arrays = watched.grower.arrays()
    with pytest.raises(ValueError, match=r"^latch: must be of what there is"):
        watched.grower.restore(arrays)
    watched.grower._latch = Context(-1, (0,), reset=4)
    watched.grower.restore(watched.grower.arrays())
    assert watched.grower._latch == Context(-1, (0,), reset=4)


def test_what_is_left_to_chance_is_told_as_hopeless_and_not_grown() -> None:
    watched, rng = Watched(), np.random.default_rng(3)
    for _ in range(400):
        watched.show("a b", "hit" if rng.random() < 0.5 else "")
    assert watched.births == []
    assert watched.grower.hopeless[0, HIT]
    assert not watched.grower.hopeless[1].any()


@given(st.data())
def test_a_cover_holds_at_no_counterexample_and_needs_all_its_literals(
    data: st.DataObject,
) -> None:
    watched = Watched()
    seen: list[tuple[set[int], set[int], int]] = []
    steps = data.draw(
        st.lists(
            st.tuples(
                st.sampled_from(BEFORE), st.sampled_from(("", "hit")), st.integers(0, 1)
            ),
            min_size=1,
            max_size=60,
        )
    )
    for before, after, action in steps:
        known = set(watched.trials())
        watched.show(before, after, action)
        now = set(np.flatnonzero(complete(bits(before))).tolist())
        came = set(np.flatnonzero(complete(bits(after))).tolist())
        seen.append((now, came, action))
        for which, literals, *_ in set(watched.trials()) - known:
            assert which == action
            assert 1 < len(literals) <= LONGEST
            assert set(literals) <= now
            # For one of the results that came, none against it is covered, and each
            # literal keeps one out.
            assert any(
                _covers(seen, action, literals, result)
                and not any(
                    _covers(seen, action, [a for a in literals if a != left], result)
                    for left in literals
                )
                for result in came
            )


def _covers(
    seen: list[tuple[set[int], set[int], int]],
    action: int,
    literals: list[int] | tuple[int, ...],
    result: int,
) -> bool:
    """Tell whether no step against a result has all the literals."""
    return not any(
        which == action and result ^ 1 in came and set(literals) <= before
        for before, came, which in seen
    )
