"""Anomalies are described in words, leaving out weak rules."""

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.anomaly_report import Link, named_anomaly, with_support

NAMES = ("door", "motion", "light")
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
    said = named_anomaly(rests_on(), NAMES)
    assert (said.tick, said.since, said.exact, said.more) == (9, 9, True, 68)
    assert said.broken[0] == Link("door -> motion", 1.0, 0.0, 1)
    assert [link.implication for link in said.broken[1:]] == [
        "motion -> door*",
        "light -> motion*",
    ]
    assert said.culprits == ("door", "light")
    assert said.candidates == ("door", "motion", "light")


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
        named_anomaly(msgspec.structs.replace(rests_on(), **changes), NAMES)


def test_what_rests_on_its_weakest_link_is_told_with_support_alone() -> None:
    anomaly = rests_on(9, 4, 5)
    assert with_support(anomaly, 4) == anomaly
    rest = with_support(anomaly, 5)
    assert rest is not None
    assert rest.links == anomaly.links[2:]
    assert (rest.culprits, rest.candidates, rest.implications) == ((2,), (1, 2), 1)
    (link,) = named_anomaly(rest, NAMES).broken
    assert (link.implication, link.occasions) == ("light -> motion*", 5)
    assert with_support(anomaly, 6) is None


def test_nothing_is_left_out_where_no_occasions_were_counted() -> None:
    assert with_support(rests_on(), 99) == rests_on()
    assert with_support(rests_on(0, 0, 0), 0) == rests_on(0, 0, 0)
