"""Anomalies are described in words, leaving out weak rules."""

from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import MessageError
from neurosnap.protocol.anomaly_report import (
    Link,
    anomaly_line,
    named_anomaly,
    with_support,
)

NAMES = ("door", "motion", "light")
BODY = Body(own=NAMES)
LINKS = ((0, 0, 2, 1.0, 0.0, 1), (0, 2, 1, 2.0, 0.0, 2), (1, 4, 3, 3.0, 0.0, 3))


def rests_on(*occasions: int) -> wire.Anomaly:
    """Return an anomaly: the door implies the motion, which implies the light by it.

    The first broken implication has two links, the second one.
    """
    return wire.Anomaly(
        tick=9,
        since=9,
        culprits=(0, 2),
        candidates=(0, 1, 2),
        exact=True,
        implications=70,
        links=tuple(
            wire.WeighedLink(*each, occasions=held)
            for each, held in zip(LINKS, occasions or (-1, -1, -1), strict=True)
        ),
    )


def test_it_says_which_implications_break_and_what_speaks_for_them() -> None:
    said = named_anomaly(rests_on(), BODY)
    assert (said.tick, said.since, said.exact, said.more) == (9, 9, True, 68)
    assert said.broken[0] == Link("door -> motion", 1.0, 0.0, 1)
    assert [link.implication for link in said.broken[1:]] == [
        "motion -> door*",
        "light -> motion*",
    ]
    assert said.culprits == ("door", "light")
    assert said.candidates == ("door", "motion", "light")


ONLY_MOTION = {"culprits": (1,), "candidates": (1,)}
OR_MOTION = {"candidates": (0, 1)}
WHILE = "door is on while motion is off: "
TOLD: list[tuple[Any, ...]] = [
    # Of each link its rule, the two literals, what was against it, and its occasions.
    (f"{WHILE}never before in 68 occasions", {}, (0, 0, 2, 0, 68)),
    (
        "door is off while motion is on: never before; the rule was never tested",
        {},
        (0, 1, 3, 0, 0),
    ),
    (f"{WHILE}only 1 time before in 12 occasions", {}, (0, 0, 2, 1, 12)),
    (f"{WHILE}only 2 times before in 1 occasion", {}, (0, 0, 2, 2, 1)),
    (f"{WHILE}seldom before in 12 occasions", {}, (0, 0, 2, 0.01, 12)),
    (f"{WHILE}never before", {}, (0, 0, 2, 0, -1)),
    ("door is on: never before in 5 occasions", {}, (0, 0, 1, 0, 5)),
    ("motion is off while door is on: never before", ONLY_MOTION, (0, 0, 2, 0, -1)),
    # A rule that follows from two rests on the weaker, and is read at its ends.
    (
        "door is on while light is off: only 3 times before in 11 occasions",
        *({}, (0, 0, 2, 0, 11), (0, 2, 4, 3, 12)),
    ),
    # The rule about the first culprit, though another rests on more.
    (
        f"{WHILE}never before in 40 occasions; 1 more rule broken, too",
        *({"implications": 2}, (0, 2, 4, 0, 50), (1, 0, 2, 0, 40)),
    ),
    ("the readings contradict what was learned", {}),
    (f"{WHILE}never before; door or motion may be wrong", OR_MOTION, (0, 0, 2, 0, -1)),
]


@pytest.mark.parametrize("told", TOLD, ids=lambda told: told[0])
def test_one_sentence_says_what_was_read_and_how_often_that_was_so(
    told: tuple[Any, ...],
) -> None:
    line, changes, *links = told
    given = {"culprits": (0,), "candidates": (0,), "implications": 1, **changes}
    weighed = [
        wire.WeighedLink(number, a, b, 9.0, against, 1, occasions)
        for number, a, b, against, occasions in links
    ]
    anomaly = msgspec.structs.replace(rests_on(), links=tuple(weighed), **given)
    assert anomaly_line(named_anomaly(anomaly, BODY)) == f"tick 9: {line}"


@pytest.mark.parametrize(
    "changes",
    [
        {"culprits": (3,)},
        {"candidates": (9,)},
        {"links": (wire.WeighedLink(0, 6, 0),)},
        {"links": (wire.WeighedLink(0, 0, 7),)},
    ],
)
def test_one_that_cannot_be_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(MessageError, match="anomaly: must"):
        named_anomaly(msgspec.structs.replace(rests_on(), **changes), BODY)


def test_what_rests_on_its_weakest_link_is_told_with_support_alone() -> None:
    anomaly = rests_on(9, 4, 5)
    assert with_support(anomaly, 4) == anomaly
    rest = with_support(anomaly, 5)
    assert rest is not None
    assert rest.links == anomaly.links[2:]
    assert (rest.culprits, rest.candidates, rest.implications) == ((2,), (1, 2), 1)
    (link,) = named_anomaly(rest, BODY).broken
    assert (link.implication, link.occasions) == ("light -> motion*", 5)
    assert with_support(anomaly, 6) is None


def test_nothing_is_left_out_where_no_occasions_were_counted() -> None:
    assert with_support(rests_on(), 99) == rests_on()
    assert with_support(rests_on(0, 0, 0), 0) == rests_on(0, 0, 0)


def test_a_rule_that_breaks_too_often_is_told_once_and_when_it_returns() -> None:
    def told(at: int, support: int = 5, since: tuple[int, ...] = (3,)) -> str:
        links = [*rests_on(9, 9, 5).links]
        for n, each in enumerate(since):
            links[n] = msgspec.structs.replace(links[n], worn=each, retired=at)
        anomaly = msgspec.structs.replace(rests_on(), links=tuple(links))
        rest = with_support(anomaly, support)
        return "" if rest is None else named_anomaly(rest, BODY).sentence

    words = "no longer go together as they did: drift, or a changed plant?"
    assert f"; since tick 3 door and motion {words}" in told(9)
    assert f"3 door and motion (2 more pairs, too) {words}" in told(9, since=(5, 3, 4))
    assert told(0).endswith("; door and motion had gone together again for long")
    assert (told(8)[:8], told(8, 6), told(8, 0)[:7]) == ("light is", "", "door is")


def test_where_a_window_may_be_wrong_its_sensors_may_be() -> None:
    body = (
        Body(own=NAMES, room=2)
        .grow(Context(-1, (0,), since=2))
        .grow(Context(-1, (1, 4)))
    )
    changes = {"culprits": (3,), "candidates": (3, 1, 4)}
    told = named_anomaly(msgspec.structs.replace(rests_on(), **changes), body)
    assert told.culprits == ("door",)
    assert told.candidates == ("door", "motion", "light")
