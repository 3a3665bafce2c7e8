import random

import pytest

from neurosnap.recording.format.completeness import (
    Completeness,
    RunningNumbers,
    added_up,
)


def test_what_was_lost_at_the_end_shows_against_the_senders_word() -> None:
    sequences = RunningNumbers()
    sequences.receive("cell/1", 0)
    sequences.receive("cell/1", 2)
    expected = {"cell/1": 5, "cell/2": 3, "world": 0}
    assert sequences.gaps(expected) == {"cell/1": [(1, 2), (3, 5)], "cell/2": [(0, 3)]}
    completeness = sequences.completeness(expected, foreign=2)
    assert completeness == Completeness(2, {"cell/1": 3, "cell/2": 3}, 0, 2)
    assert not completeness.whole
    assert sequences.gaps() == {"cell/1": [(1, 2)]}, "asking changes nothing"


@pytest.mark.parametrize("seed", range(30))
def test_any_order_comes_to_what_a_plain_set_comes_to(seed: int) -> None:
    """The share of a file begins with a number, or with what comes first."""
    draw = random.Random(seed)
    heard = draw.choices(range(60), k=80)
    first = draw.choice((0, 0, 7))
    anywhere = seed % 3 == 0
    sequences = RunningNumbers({} if anywhere else {"cell/1": first}, anywhere=anywhere)
    first = heard[0] if anywhere else first
    if not anywhere:
        sequences.begin("cell/1", first + 5)  # it has begun already
    seen, duplicates = set[int](), 0
    for number in heard:
        fresh = number >= first and number not in seen
        assert sequences.receive("cell/1", number) is fresh
        duplicates += not fresh
        seen |= {number} if fresh else set()
    assert sequences.first == {"cell/1": first}
    assert (sequences.upcoming("cell/1"), sequences.upcoming("x")) == (max(seen) + 1, 0)
    missing = {
        number
        for start, stop in sequences.gaps({"cell/1": 60})["cell/1"]
        for number in range(start, stop)
    }
    assert missing == set(range(first, 60)) - seen
    assert (sequences.messages, sequences.duplicates) == (len(seen), duplicates)


def test_what_several_files_hold_and_lack_is_added_up() -> None:
    lacking = [Completeness(1, vanished=("a.mcap",)), Completeness(2, gaps=1)]
    both = added_up([*lacking, Completeness(3, {"world": 2}), Completeness(4)])
    assert both == Completeness(10, {"world": 2}, vanished=("a.mcap",), gaps=1)
    assert not any(each.whole for each in (*lacking, both))
