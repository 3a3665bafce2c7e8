"""Questions about past readings, to be answered by one process or by many cells.

A search is a coroutine that yields a question and is sent the answer. So it does not
matter who has the history: one object, or the cells, each that of its own sensor.
"""

from collections.abc import Callable, Generator, Sequence
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.literal_sets import Words

A = TypeVar("A")
Q = TypeVar("Q")
T = TypeVar("T")
Numbers: TypeAlias = NDArray[np.intp]


class Count(NamedTuple):
    """Asks for the number of the given ticks at which each given literal was read."""

    within: Words
    """``(W,)``, the ticks, as bits of a ring."""
    literals: Numbers
    """``(n,)``."""


class Question(NamedTuple):
    """One question to a history."""

    readings: tuple[int, ...] = ()
    """Literals: the ticks at which each was read, each literal once."""
    counts: tuple[Count, ...] = ()
    """What is to be counted."""


class Answer(NamedTuple):
    """The answer of a history to one question."""

    readings: dict[int, Words]
    """By literal: ``(W,)``, the ticks at which it was read, as bits of the ring."""
    counts: tuple[NDArray[Any], ...]
    """For each count ``(n,)``."""


Search: TypeAlias = Generator[Question, Answer, T]
"""Asks a history, and returns what it has found."""


def answered(asking: Generator[Q, A, T], answer: Callable[[Q], A]) -> T:
    """Run a search, or another generator that asks, and return its result."""
    try:
        question = next(asking)
        while True:
            question = asking.send(answer(question))
    except StopIteration as end:
        found: T = end.value
        return found


def together(searches: Sequence[Search[T]]) -> Search[list[T]]:
    """Run several searches at once, all of them one question further each time.

    It takes as many questions as the longest.

    Returns:
        What each has found.
    """
    found: dict[int, T] = {}
    asked: dict[int, Question] = {}

    def go_on(place: int, answer: Answer | None) -> None:
        try:
            # None starts it.
            asked[place] = searches[place].send(answer)  # type: ignore[arg-type]
        except StopIteration as end:
            found[place] = end.value

    for place in range(len(searches)):
        go_on(place, None)
    while asked:
        under_way = asked.copy()
        asked.clear()
        readings = (a for question in under_way.values() for a in question.readings)
        counts = (one for question in under_way.values() for one in question.counts)
        answer = yield Question(tuple(dict.fromkeys(readings)), tuple(counts))
        first = 0
        for place, question in under_way.items():
            last = first + len(question.counts)
            go_on(place, Answer(answer.readings, answer.counts[first:last]))
            first = last
    return [found[place] for place in range(len(searches))]


def nothing() -> Search[None]:
    """Ask nothing, and find nothing."""
    yield from ()
