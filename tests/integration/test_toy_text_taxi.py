"""What a planner that learned to drive a taxi is good for."""

import itertools
from collections import Counter
from typing import Any

from tests.support.taught_agents import PATIENCE, Taught, attempt, tile, walker
from world.toy_text import taxi

STOPS = {"red": (0, 0), "green": (0, 4), "yellow": (4, 0), "blue": (4, 3)}


def cab_at(cab: Taught, row: int, column: int, passenger: int, destination: int) -> int:
    inner: Any = cab.env.unwrapped
    state = inner.encode(row, column, passenger, destination)
    return int(((cab.table.states == state) & ~cab.table.over).argmax())


def test_walls_stop_the_planner_but_in_the_row_that_has_none() -> None:
    cab = walker(taxi)
    found = Counter[tuple[int, bool]]()
    for row, column in itertools.product(range(5), repeat=2):
        goal = tile(cab.env, row, column)
        at = cab.at(goal)
        for stop in STOPS.values():
            start = cab_at(cab, *stop, 0, 1)
            if not at[start]:
                way = attempt(cab, start, at, goal=goal)
                there = cab.table.states[at].tolist()
                found[row, way[-1][0] in there] += 1
    # The middle row is open. To the others it goes straight, and stays at a wall.
    assert [found[row, True] for row in range(5)] == [8, 10, 20, 8, 6]
    assert [found[row, False] for row in range(5)] == [10, 10, 0, 12, 12]
    # East never leads back, but whether it leads on is known in the last columns only:
    # elsewhere it depends on the row, and a context is a single sensation.
    for k in range(1, 5):
        assert cab.believes(f"east&~column<{k}", f"column<{k}*")
    assert not cab.believes("west&column<2", "column<1")
    assert not cab.believes("east&~column<2", "column<3*")
    assert cab.believes("east&~column<3", "column<4*")


def test_a_fare_ends_where_what_matters_is_two_things_at_once() -> None:
    cab = walker(taxi)
    # To be picked up, one must be where the taxi is: no single sensation says so.
    assert not cab.believes("pickup&passenger=red", "passenger=taxi")
    assert not cab.believes("dropoff&passenger=taxi", "passenger=taxi*")
    assert cab.believes("pickup&passenger=taxi", "passenger=taxi")
    assert cab.believes("dropoff&passenger=red", "passenger=red")
    # At its stop it happens, since nothing else is better; the delivery does not:
    # to keep the passenger guarantees more.
    for number, (name, stop) in enumerate(STOPS.items()):
        waiting = cab_at(cab, *stop, number, (number + 1) % 4)
        way = attempt(cab, waiting, cab.at(["passenger=taxi"]), goal=["passenger=taxi"])
        assert len(way) - 1 < PATIENCE
        arrived = cab_at(cab, *stop, 4, number)
        goal = (*tile(cab.env, *stop), f"passenger={name}")
        at = cab.at(goal) & cab.table.over
        assert len(attempt(cab, arrived, at, goal=goal)) - 1 == PATIENCE
