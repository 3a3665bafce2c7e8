"""The coordinator's side of learning that workers share."""

from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import AnswerLostError, MessageError
from neurosnap.protocol.learn_control import LearnControl

SHARES = (range(3), range(3, 5))
LEARN = wire.Learn(4, b"\1", sources=(2, 9), targets=(1, 0))


def control(repeats: int = 1) -> LearnControl:
    made = LearnControl(SHARES, repeats)
    assert made.ask(LEARN) == [LEARN]
    return made


def learned(worker: int, **changes: Any) -> wire.Learned:
    return wire.Learned(worker, 4, **{"links": (weighed(worker),), **changes})


def weighed(worker: int, support: float = 3.0, since: int = 2) -> wire.WeighedLink:
    """Return what spoke for the implication asked for that is of a worker's pairs."""
    source, target = LEARN.sources[worker], LEARN.targets[worker]
    return wire.WeighedLink(worker, source, target, support, 1.0, since)


def took(asked: LearnControl, message: wire.Learned) -> bool:
    return asked.receive(message) is not None


def under_way(asked: LearnControl) -> bool:
    return asked.under_way is not None


def test_all_is_learned_once_all_have_answered() -> None:
    first = wire.Learned(1, 4, part=0, parts=2)
    last = learned(1, part=1, parts=2)
    for order in ((last, learned(0), first), (first, last, learned(0))):
        asked = control()
        *early, end = order
        for each in early:
            assert took(asked, each)
            assert not took(asked, each), "it came before"
            assert under_way(asked)
        assert took(asked, end)
        assert not under_way(asked)
        assert asked.repeat() == []
        assert not took(asked, end), "what comes late is dropped"


def test_what_changed_is_what_the_message_says() -> None:
    pairs = control().receive(
        learned(
            0,
            latter=b"\2\0\0\0\1\0\0\0",
            former=b"\1\0\0\0\0\0\0\0",
            codes=b"\2\x0c",
        )
    )
    assert pairs is not None
    assert [each.tolist() for each in pairs] == [[2, 1], [1, 0], [2, 12]]


def test_an_answer_to_an_earlier_question_is_dropped() -> None:
    asked = control()
    assert not took(asked, wire.Learned(0, 3))
    assert took(asked, learned(0))
    assert took(asked, learned(1))
    (bands,) = asked.ask_bands(4)
    assert bands == msgspec.structs.replace(LEARN, frame=4)
    assert not took(asked, learned(0)), "its bands did not go before it"
    assert took(asked, learned(0, frame=4))
    assert took(asked, learned(1, frame=4))
    assert not under_way(asked)
    asked.begins = 7
    assert asked.ask_bands(5) == [wire.Learn(5, frame=5, begins=7)]
    asked.forget()
    assert not under_way(asked)


def test_who_is_silent_is_told_again_and_then_named() -> None:
    asked = control(repeats=2)
    assert asked.repeat() == [LEARN]
    assert took(asked, learned(0))
    assert asked.repeat() == [LEARN]
    with pytest.raises(AnswerLostError, match=r"tick 4.*3 tries; silent: worker/1$"):
        asked.repeat()
    assert LearnControl(SHARES, 1).repeat() == []


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        (wire.Learned(0, 5), "must be of tick 4, key-frame 0, got tick 5"),
        (wire.Learned(2, 4), "must be one of 2 workers, got worker 2"),
        (learned(0, part=1), "part must be one of 1, got 1 of 1"),
        (wire.Learned(1, 4, part=2, parts=3), "part must be one of 2, got 2 of 3"),
        (learned(0, links=(weighed(1),)), "links must be of 1 implications"),
        (learned(0, links=()), "links must be of 1 implications"),
        (learned(0, links=(weighed(0, float("inf")),)), "support must be finite"),
        (
            learned(0, latter=b"\3\0\0\0", former=b"\0\0\0\0", codes=b"\1"),
            "latter must be in 0 to 2, got 3",
        ),
        (learned(0, latter=b"\3"), "latter: must be four bytes a number, got 1"),
        (
            learned(0, latter=b"\2\0\0\0", former=b"\1\0\0\0", codes=b"\5"),
            "codes must be of pairs",
        ),
        (learned(0, latter=b"\2\0\0\0"), "as many former as latter, got 1, 0 and 0"),
        (
            learned(0, latter=b"\2\0\0\0", former=b"\2\0\0\0", codes=b"\1"),
            "former must be before latter",
        ),
    ],
)
def test_what_cannot_be_right_is_refused(wrong: wire.Learned, rule: str) -> None:
    asked = control()
    assert took(asked, wire.Learned(1, 4, part=0, parts=2))
    with pytest.raises(MessageError, match=rule):
        asked.receive(wrong)
    assert took(asked, learned(0))
    assert took(asked, learned(1, part=1, parts=2))
    assert not under_way(asked)


def test_an_anomaly_gets_what_spoke_for_what_it_broke() -> None:
    bare = wire.Anomaly(
        tick=4,
        since=4,
        culprits=(0,),
        candidates=(0,),
        exact=True,
        implications=2,
        links=tuple(
            wire.WeighedLink(number, a, b)
            for number, a, b in ((0, 2, 1), (1, 9, 0), (1, 4, 5), (1, 2, 1))
        ),
    )
    asked = LearnControl(SHARES, repeats=1)
    # Once each, and none of one sensor.
    assert asked.ask_to_learn(wire.Observation(4, b"\1"), bare) == [LEARN]
    asked.receive(learned(0))
    asked.receive(learned(1, links=(weighed(1, 5.0, 3),)))
    full = asked.weighed(bare)
    found = [(one.support, one.against, one.since) for one in full.links]
    assert found == [(3.0, 1.0, 2), (5.0, 1.0, 3), (0.0, 0.0, 0), (3.0, 1.0, 2)]
