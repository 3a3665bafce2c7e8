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
    assert sequences.gaps(expected) == {
        "cell/1": [(1, 2), (3, 5)],
        "cell/2": [(0, 3)],
    }
    completeness = sequences.completeness(expected, foreign=2)
    assert completeness == Completeness(2, {"cell/1": 3, "cell/2": 3}, 0, 2)
    assert not completeness.whole
    assert sequences.gaps() == {"cell/1": [(1, 2)]}, "asking changes nothing"


@pytest.mark.parametrize("seed", range(20))
def test_any_order_comes_to_what_a_plain_set_comes_to(seed: int) -> None:
    draw = random.Random(seed)
    sequences, seen, duplicates = RunningNumbers(), set[int](), 0
    for number in draw.choices(range(60), k=80):
        assert sequences.receive("cell/1", number) is (number not in seen)
        duplicates += number in seen
        seen.add(number)
    assert (sequences.upcoming("cell/1"), sequences.upcoming("x")) == (max(seen) + 1, 0)
    missing = {
        number
        for start, stop in sequences.gaps({"cell/1": 60})["cell/1"]
        for number in range(start, stop)
    }
    assert missing == set(range(60)) - seen
    assert (sequences.messages, sequences.duplicates) == (len(seen), duplicates)


# A share of them ----------------------------------------------------------------------


def test_what_is_below_a_share_is_no_loss_and_no_message_of_it() -> None:
    sequences = RunningNumbers({"world": 7, "cell/0": 3})
    sequences.begin("world", 5)  # it has begun already
    assert sequences.first == {"world": 7, "cell/0": 3}
    assert sequences.receive("world", 7)
    assert not sequences.receive("world", 6)
    assert sequences.completeness({"world": 8, "cell/0": 3}) == Completeness(1, {}, 1)
    assert sequences.completeness({"cell/0": 5}).missing == {"cell/0": 2}


def test_a_share_may_begin_with_what_comes_first() -> None:
    sequences = RunningNumbers({"world": 7}, anywhere=True)
    for number in (20, 22):
        assert sequences.receive("cell/0", number)
    assert sequences.receive("world", 8)
    assert sequences.gaps() == {"cell/0": [(21, 22)], "world": [(7, 8)]}
    assert sequences.first == {"world": 7, "cell/0": 20}
    assert sequences.messages == 3


def test_what_several_files_hold_and_lack_is_added_up() -> None:
    lacking = [Completeness(1, vanished=("a.mcap",)), Completeness(2, gaps=1)]
    both = added_up([*lacking, Completeness(3, {"world": 2}), Completeness(4)])
    assert both == Completeness(10, {"world": 2}, vanished=("a.mcap",), gaps=1)
    assert not any(each.whole for each in (*lacking, both))
