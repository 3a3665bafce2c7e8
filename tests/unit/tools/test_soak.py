"""The random killer: which parts it kills, when, and its counts."""

import asyncio
import random
import signal
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from typing import Any

import msgspec
import psutil
import pytest

from tools.soak.__main__ import Soaked
from tools.soak.killer import Killer, deck
from tools.soak.outside import BITS, Lines, compared

ROLES = ("hub", "recorder", "coordinator", "world", "cell")


def test_each_role_and_each_pair_is_drawn_as_often_as_any_other() -> None:
    drawn = [*islice(deck(ROLES, random.Random(1)), 45)]
    counts = Counter(frozenset(victims) for victims in drawn)
    assert len(counts) == 15
    assert set(counts.values()) == {3}
    assert Counter(map(len, counts)) == {1: 5, 2: 10}
    first, second, third = drawn[:15], drawn[15:30], drawn[30:]
    assert set(first) == set(second) == set(third)
    assert first != second != third


class Target:
    """A process that notes what it is sent."""

    def __init__(self, sent: list[str], who: str) -> None:
        self._sent = sent
        self._who = who

    def send_signal(self, number: int) -> None:
        assert number == signal.SIGKILL
        self._sent.append(self._who)


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Who is killed of a swarm that is all there."""
    sent: list[str] = []

    def parts_of(launcher: psutil.Process) -> Iterator[tuple[str, Target]]:
        yield from ((who, Target(sent, who)) for who in ("hub", "cell/0"))

    monkeypatch.setattr("tools.soak.killer.parts_of", parts_of)
    return sent


async def settled(killer: Killer) -> int:
    """Return how often it has killed, once it has done all it does by itself."""
    for _ in range(20):
        await asyncio.sleep(0)
    return killer.killed.total()


async def test_nobody_is_killed_before_the_run_has_gone_on(sent: list[str]) -> None:
    killer = Killer(("hub", "cell"), 3, 1, pause=0.0)
    hunting = asyncio.create_task(killer.hunt(psutil.Process()))
    assert await settled(killer) == 0
    killer.follow(7)
    assert await settled(killer) == 1
    killer.follow(9)  # told by the life that is over
    assert await settled(killer) == 1
    killer.restarted(6, 3)
    killer.follow(6)  # where it goes on from
    assert await settled(killer) == 1
    killer.restarted(6, 0)  # it has failed to come up
    killer.follow(7)
    assert await settled(killer) == 2
    killer.restarted(7, 0)
    killer.follow(8)
    assert await settled(killer) == 3
    assert not hunting.done()
    killer.restarted(8, 0)
    killer.follow(9)
    await hunting
    assert sorted(sent) == ["cell/0", "cell/0", "hub", "hub"]  # each alone, and both
    assert killer.restarts == 4
    assert (killer.redone, killer.killed.total()) == (3, 3)


@pytest.mark.parametrize(
    ("readings", "lines", "found"),
    [
        ([1, 2, 3], 3, Lines(lost=0, doubled=0, exact=True)),
        ([1, 2, 2, 5], 5, Lines(lost=2, doubled=1, exact=False)),
        ([2, 1], 2, Lines(lost=0, doubled=0, exact=False)),
        ([1], 3, Lines(lost=2, doubled=0, exact=False)),
        ([], 0, Lines(lost=0, doubled=0, exact=True)),
    ],
)
def test_lines_are_known_by_their_numbers(
    readings: list[int], lines: int, found: Lines
) -> None:
    assert compared(readings, lines) == found


def test_more_lines_than_the_sensors_can_count_are_told_apart() -> None:
    size = 1 << BITS
    numbers = [*range(1, 3 * size)]
    assert compared((n % size for n in numbers), len(numbers)).exact
    del numbers[size + 5 : size + 8]
    numbers.insert(2 * size, numbers[2 * size - 1])
    found = compared((n % size for n in numbers), 3 * size - 1)
    assert found == Lines(lost=3, doubled=1, exact=False)


NONE = {each.name: 0 for each in msgspec.structs.fields(Soaked) if each.required}
WELL: dict[str, Any] = {"killed": {}, "equal": True, "verified": True, "left": []}
FINE = msgspec.convert({**NONE, **WELL}, Soaked)


@pytest.mark.parametrize(
    "wrong",
    [
        {"lost": 1},
        {"doubled": 1},
        {"equal": False},
        {"verified": False},
        {"left": ["soaked.mcap.broken"]},
        {"code": 3},
    ],
    ids=str,
)
def test_anything_wrong_is_not_fine(wrong: dict[str, Any]) -> None:
    assert FINE.fine
    assert not msgspec.structs.replace(FINE, **wrong).fine
