"""Cells' own histories give the same answers as one shared history."""

from collections.abc import Sequence

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.grower import LONGEST, Candidates, cover
from neurosnap.errors import AnswerLostError, MessageError
from neurosnap.poc.learning.history_questions import Answer, Count, Question, answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.protocol.recall_control import RecallControl
from tests.support.swarm_parts import Row, hosting, observation

LENGTH = 64
Bits = NDArray[np.bool_]


def entered(rows: Sequence[Row]) -> History:
    history = History(len(rows[0]), LENGTH)
    for row in rows:
        known = np.array([on is not None for on in row])
        history.record(np.array([on is True for on in row]), known)
    return history


class Cells:
    """Cells, alone or in workers, that have heard of some readings, and are asked."""

    def __init__(self, sensors: int, workers: int) -> None:
        self.hosts = hosting(sensors, workers)
        self.control = RecallControl(sensors, 2, workers)
        self.reminders = 0
        self.tick = 0

    def hear(self, row: Row, deaf: str = "") -> None:
        self.tick += 1
        for who, host in self.hosts.items():
            if who != deaf:
                assert host.receive([observation(self.tick, row)]) == []

    def ask(self, question: Question, history: History) -> Answer:
        said = self.control.ask(self.tick, question)
        while True:
            answers = [one for message in said for one in self._pass_on(message)]
            assert answers, "nobody is asked anything"
            for answer in (*answers, *answers):  # each of them twice
                heard = self.control.receive(answer, history)
                if isinstance(heard, Answer):
                    return heard
                if heard:
                    said = heard
                    break

    def _pass_on(self, message: wire.Message) -> list[wire.Recalled]:
        key, payload = message.key, wire.encode(message)
        copy = wire.decode(key, payload)
        self.reminders += isinstance(copy, wire.Reminder)
        addressed = key.partition("/")[2]
        who = f"cell/{addressed}" if addressed.isdigit() else addressed
        found = [
            answer
            for name, host in self.hosts.items()
            if who in ("", name)
            for answer in host.receive([copy])
        ]
        return [one for one in found if isinstance(one, wire.Recalled)]


def same(one: Answer, other: Answer) -> None:
    assert one.readings.keys() == other.readings.keys()
    for literal, ring in one.readings.items():
        assert ring.tolist() == other.readings[literal].tolist()
    assert [c.tolist() for c in one.counts] == [c.tolist() for c in other.counts]


def test_many_histories_come_in_several_messages() -> None:
    """A message of all histories of a large worker would be larger than any may be."""
    shown: list[Row] = [[True] * 130, [False] * 130]
    cells, history = Cells(130, 1), entered(shown)
    for row in shown:
        cells.hear(row)
    question = Question((), (Count(np.array([3], np.uint64), np.arange(260)),))
    same(cells.ask(question, history), history.answer(question))
    assert cells.reminders == 3


@st.composite
def rows(draw: st.DrawFn) -> list[Row]:
    """Draw readings, of which some are unknown; there may be more than are kept."""
    sensors, ticks = draw(st.integers(2, 5)), draw(st.integers(1, 150))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    share = rng.random(sensors)
    known = rng.random((ticks, sensors)) < draw(st.sampled_from([0.8, 1.0]))
    known[:, 0] = True  # an observation has one at least
    bits = rng.random((ticks, sensors)) < share
    return [
        [bool(on) if sure else None for on, sure in zip(*both, strict=True)]
        for both in zip(bits, known, strict=True)
    ]


@st.composite
def questions(draw: st.DrawFn, sensors: int) -> Question:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    literals = st.lists(st.integers(0, 2 * sensors - 1), unique=True)

    def ring() -> NDArray[np.uint64]:
        return rng.integers(0, 2**64, LENGTH // 64, np.uint64)

    readings = tuple(draw(literals))
    # One that is asked for at least, or there is no question.
    several = [*draw(st.lists(literals, max_size=2)), [draw(st.integers(0, sensors))]]
    counts = tuple(Count(ring(), np.array(one, np.intp)) for one in several)
    return Question(readings, counts)


@pytest.mark.parametrize("shared", [False, True])
@given(data=st.data(), shown=rows())
def test_cells_answer_as_one_history(
    shared: bool, data: st.DataObject, shown: list[Row]
) -> None:
    sensors = len(shown[0])
    workers = data.draw(st.integers(1, sensors)) if shared else 0
    cells = Cells(sensors, workers)
    asked = data.draw(st.sets(st.integers(1, len(shown)), max_size=4)) | {len(shown)}
    missed = data.draw(st.sets(st.integers(1, len(shown)), max_size=2))
    for tick, row in enumerate(shown, 1):
        deaf = data.draw(st.sampled_from(sorted(cells.hosts))) if tick in missed else ""
        cells.hear(row, deaf)
        if tick in asked:
            history, question = entered(shown[:tick]), data.draw(questions(sensors))
            same(cells.ask(question, history), history.answer(question))


@pytest.mark.parametrize("workers", [0, 2])
def test_a_cell_is_reminded_once_and_again_when_it_has_missed_a_reading(
    workers: int,
) -> None:
    shown: list[Row] = [[True, False], [False, True], [True, True], [None, True]]
    cells = Cells(2, workers)
    question, reminders = Question(readings=(0, 2, 3)), []
    deaf = ["", "", sorted(cells.hosts)[1], ""]
    for tick, row in enumerate(shown, 1):
        cells.hear(row, deaf[tick - 1])
        history = entered(shown[:tick])
        same(cells.ask(question, history), history.answer(question))
        reminders.append(cells.reminders)
    assert reminders == [2, 2, 3, 3]


def test_only_cells_that_lacked_their_history_are_asked_again() -> None:
    control, history = RecallControl(4, 2, 0), History(4, LENGTH)
    history.tick = 4
    control.ask(4, Question(readings=(0, 2, 4, 6)))
    said: Answer | list[wire.Message] = []
    for cell in range(4):
        lacks = (cell,) if cell == 2 else ()
        said = control.receive(wire.Recalled(f"cell/{cell}", 4, 1, lacks), history)
    assert isinstance(said, list)
    assert [type(one) for one in said] == [wire.Reminder, wire.Recall]
    assert said[1].key == "recall/2"
    whole = control.receive(wire.Recalled("cell/2", 4, 2), history)
    assert isinstance(whole, Answer)
    assert set(whole.readings) == {0, 2, 4, 6}


def test_who_stays_silent_is_named() -> None:
    control = RecallControl(3, 2, 0)
    [first] = control.ask(4, Question(readings=(0, 2)))
    assert isinstance(first, wire.Recall)
    control.receive(wire.Recalled("cell/0", 4, 1, readings=b"\1"), History(3, 64))
    for round_ in (2, 3):
        [again] = control.repeat()
        assert isinstance(again, wire.Recall)
        assert (again.round, again.repeats) == (round_, round_ - 1)
        # What came of the round before is not counted.
        stale = wire.Recalled("cell/1", 4, round_ - 1, readings=b"")
        assert control.receive(stale, History(3, 64)) == []
    with pytest.raises(
        AnswerLostError, match=r"^recall 3 \(tick 4\): .* 3 tries;.* cell/0, cell/1$"
    ):
        control.repeat()


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"round": 2}, "must be to round 1 of tick 4, got 2 of 4"),
        ({"who": "cell/3"}, "must be asked, got cell/3"),
        ({"lacks": (1,)}, "must lack histories of cells of cell/0 that were asked"),
        ({"readings": bytes(9)}, "must have up to 64 bits a ring, got 72"),
        ({"counts": b"\x41\0\0\0"}, "must be in 0..64, got"),
        ({"counts": b"\1\0\0"}, "must be four bytes a number, got 3"),
        ({"counts": b""}, "must be of 1 literals, got 0"),
    ],
)
def test_an_answer_that_cannot_be_right_is_refused(
    wrong: dict[str, object], rule: str
) -> None:
    ring = np.ones(1, np.uint64)
    count = Count(ring, np.array([1, 4]))
    question = Question((0,), (count,))
    control = RecallControl(4, 2, 0)
    control.ask(4, question)
    answer = wire.Recalled("cell/0", 4, 1, (), b"\1", bytes(4))
    with pytest.raises(MessageError, match=rule):
        control.receive(msgspec.structs.replace(answer, **wrong), History(4, 64))
    assert control.receive(answer, History(4, 64)) == []


# The search ---------------------------------------------------------------------------


def plain_cover(against: Bits, held: Bits) -> list[int] | None:
    """Return what `cover` finds, by lists of ticks: ``(T,)`` and ``(T, n)`` flags."""
    left, chosen = set(np.flatnonzero(against)), list[int]()
    while left:
        if len(chosen) == LONGEST or not held.shape[1]:
            return None
        remain = [sum(bool(held[t, k]) for t in left) for k in range(held.shape[1])]
        best = remain.index(min(remain))
        if remain[best] == len(left):
            return None
        chosen.append(best)
        left = {t for t in left if held[t, best]}
    for one in chosen.copy():
        rest = [other for other in chosen if other != one]
        if not any(held[t, rest].all() for t in np.flatnonzero(against)):
            chosen = rest
    return sorted(chosen)


@given(shown=rows(), seed=st.integers(0, 2**32 - 1))
def test_a_cover_is_what_a_plain_search_finds(shown: list[Row], seed: int) -> None:
    history, rng = entered(shown), np.random.default_rng(seed)
    literals = rng.permutation(2 * len(shown[0]))[: rng.integers(1, 6)]
    several = [Candidates(literals, literals)]
    if rng.random() < 0.5:
        several.append(Candidates(100 + literals, literals, before=True))
    first = max(0, len(shown) - LENGTH)
    wanted = rng.random(len(shown)) < 0.3
    wanted[:first] = False
    against = np.zeros(1, np.uint64)
    for tick in np.flatnonzero(wanted).tolist():
        against |= np.uint64(1) << np.uint64(tick % 64)
    read = np.array(
        [[row[a >> 1] is not bool(a & 1) for a in literals] for row in shown]
    )
    read &= np.array([[row[a >> 1] is not None for a in literals] for row in shown])
    read[:first] = False
    held = [read]
    if len(several) > 1:
        held.append(np.vstack((np.zeros_like(read[:1]), read[:-1])))
        held[1][first] = False  # what was before is not known
    names = np.concatenate([one.literals for one in several])
    expected = plain_cover(wanted, np.hstack(held))
    found = answered(cover(against, several, len(shown)), history.answer)
    if expected is None:
        assert found is None
    else:
        assert found == tuple(sorted(names[expected].tolist()))
