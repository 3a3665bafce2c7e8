"""The coordinator's questions to the histories of the cells, and their answers.

Pure: a question in, messages out; answers in, and once the last has come, what they
come to. One question is under way at a time. Cells that say they lack a history get it
from the coordinator, which keeps one for its key-frames, and are asked again. What is
asked follows from the question and from what parts lack, whatever the order in which
the answers came.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.poc.learning.history_questions import Answer, Question
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.order.literal_sets import Words
from neurosnap.protocol.ask_until_answered import Round
from neurosnap.protocol.cell_histories import PartHistory, check_recall, check_rings
from neurosnap.protocol.worker_shares import hosts, shares

_REMINDED = 64  # cells in one message, at most: no session takes in what is very large


class RecallControl:
    """Asks cells and workers about past readings, and joins their answers.

    Args:
        sensors: How many cells there are.
        repeats: How often a question that is not answered is asked again.
        workers: How many workers share the cells; 0 if every cell is a part by itself.

    Attributes:
        recall: The question that is not answered yet; None if there is none.
    """

    def __init__(self, sensors: int, repeats: int, workers: int) -> None:
        self._sensors = sensors
        self._repeats = repeats
        self._all_hear = workers > 0
        self._names = hosts(sensors, workers)
        self._hosted = shares(sensors, workers or sensors)
        self.recall: wire.Recall | None = None
        self._question = Question()
        self._asked: dict[str, list[int]] = {}  # the cells of each part that are asked
        self._tick = self._number = 0  # of the last round
        self._round: Round[wire.Recalled] = Round("", repeats)

    def _cells_of(self, who: str) -> range:
        """Return the cells of a part; none, if it has none."""
        known = who in self._names
        return self._hosted[self._names.index(who)] if known else range(0)

    def ask(self, tick: int, question: Question) -> list[wire.Message]:
        """Return the messages that ask the cells, about their readings up to a tick."""
        if tick != self._tick:
            self._tick, self._number = tick, 0
        self._question = question
        recall = wire.Recall(
            tick=tick,
            round=1,
            readings=question.readings,
            within=wire.joined_rings([_packed(one.within) for one in question.counts]),
            counted=b"".join(
                one.literals.astype("<i4").tobytes() for one in question.counts
            ),
            sizes=tuple(len(one.literals) for one in question.counts),
        )
        cells = _cells_asked(recall, range(self._sensors))
        starts = np.array([part.start for part in self._hosted])
        owners = np.searchsorted(starts, cells, side="right") - 1
        self._asked = {}
        for owner, cell in zip(owners.tolist(), cells, strict=True):
            self._asked.setdefault(self._names[owner], []).append(cell)
        self._round = Round("", self._repeats, self._asked)
        return self._begin(recall, 0, cells)

    def _begin(
        self, recall: wire.Recall, repeats: int, cells: list[int]
    ) -> list[wire.Message]:
        """Ask some cells; those of parts that have answered are not among them."""
        self._number += 1
        self._round.what = f"recall {self._number} (tick {recall.tick})"
        replace = msgspec.structs.replace
        self.recall = recall = replace(recall, round=self._number, repeats=repeats)
        if self._all_hear or 2 * len(cells) > self._sensors:
            return [recall]
        return [replace(recall, cell=cell) for cell in cells]

    def repeat(self) -> list[wire.Message]:
        """Give up the round under way and ask again.

        Raises:
            AnswerLostError: It was asked as often as allowed; the error names the
                parts that have not answered.
        """
        recall = self.recall
        if recall is None:
            return []
        self._round.ask_again(self._round.silent)
        # An answer to a round that is given up does not count: all are asked again.
        self._round.answers = dict.fromkeys(self._asked)
        cells = sorted(cell for cells in self._asked.values() for cell in cells)
        return self._begin(recall, recall.round, cells)

    def receive(
        self, answer: wire.Recalled, history: History
    ) -> Answer | list[wire.Message]:
        """Receive an answer. Return what all say, or what is to be sent.

        An answer of a round that was given up, or that came before, is dropped.

        Args:
            answer: A part's.
            history: What the coordinator has kept for parts that lack theirs.

        Raises:
            MessageError: It cannot be right.
            AnswerLostError: As for `repeat`: cells lack what they were reminded of.
        """
        recall = self.recall
        here = answer.tick, answer.round
        if here > (self._tick, self._number):
            rule = f"must be to round {self._number} of tick {self._tick}"
            raise MessageError(f"recalled: {rule}, got {here[1]} of {here[0]}")
        if recall is None or here != (recall.tick, recall.round):
            return []
        if answer.who not in self._asked:
            raise MessageError(f"recalled: must be asked, got {answer.who:.40}")
        self._check(answer, recall, history.length)
        answers = self._round.answers
        answers[answer.who] = answers[answer.who] or answer
        if self._round.silent:
            return []
        # In the order of the cells: it does not matter who answered first.
        lacking = {w: sorted(one.lacks) for w, one in answers.items() if one}
        lacking = {who: lacks for who, lacks in lacking.items() if lacks}
        if not lacking:
            self.recall = None
            return self._whole(recall, history.length)
        self._round.ask_again([*lacking], "without a history", spare=1)
        reminders = [
            _reminder(who, recall.tick, tuple(lacks[at : at + _REMINDED]), history)
            for who, lacks in lacking.items()
            for at in range(0, len(lacks), _REMINDED)
        ]
        answers.update(dict.fromkeys(lacking))
        cells = [cell for who in lacking for cell in self._asked[who]]
        return [*reminders, *self._begin(recall, 0, cells)]

    def _check(self, answer: wire.Recalled, recall: wire.Recall, length: int) -> None:
        """Refuse an answer that does not fit the question."""
        if answer.lacks:
            lacks, asked = set(answer.lacks), self._asked[answer.who]
            if len(lacks) < len(answer.lacks) or lacks.difference(asked):
                rule = f"must lack histories of cells of {answer.who} that were asked"
                raise MessageError(f"recalled: {rule}, got {answer.lacks}")
            return
        cells = self._cells_of(answer.who)
        readings = len(_own(np.array(recall.readings, np.intp), cells))
        several = self._question.counts
        counted = sum(len(_own(one.literals, cells)) for one in several)
        rings = wire.split_rings("recalled: readings", answer.readings, readings)
        check_rings("recalled", rings, length)
        counts = wire.numbers("recalled: counts", answer.counts)
        if len(counts) != counted:
            rule = f"must be of {counted} literals"
            raise MessageError(f"recalled: counts: {rule}, got {len(counts)}")
        if counts and not 0 <= min(counts) <= max(counts) <= length:
            rule = f"must be in 0..{length}"
            raise MessageError(f"recalled: counts: {rule}, got {counts[:10]}")

    def answer(
        self, who: str, recall: wire.Recall, history: History
    ) -> list[wire.Message]:
        """Return what a part answers to a question that lacks nothing of a history.

        Raises:
            MessageError: The question cannot be right.
        """
        part = PartHistory(who, self._cells_of(who))
        asked = _cells_asked(recall, self._cells_of(who))
        if asked:
            part.remember(_reminder(who, recall.tick, tuple(asked), history))
        return part.answer(recall)

    def _whole(self, recall: wire.Recall, length: int) -> Answer:
        """Return what all parts say."""
        readings: dict[int, NDArray[np.uint64]] = {}
        counts = [
            np.zeros(len(one.literals), np.int64) for one in self._question.counts
        ]
        asked = np.array(recall.readings, np.intp)
        for who, answer in self._round.answers.items():
            if answer is None:
                continue
            cells = self._cells_of(who)
            literals = asked[_own(asked, cells)].tolist()
            rings = wire.split_rings("recalled", answer.readings, len(literals))
            for literal, ring in zip(literals, rings, strict=True):
                words = ring.ljust(length // 8, b"\0")
                readings[literal] = np.frombuffer(words, "<u8").astype(np.uint64)
            found, first = np.frombuffer(answer.counts, "<i4"), 0
            for count, one in zip(counts, self._question.counts, strict=True):
                own = _own(one.literals, cells)
                count[own] = found[first : first + len(own)]
                first += len(own)
        return Answer(readings, tuple(counts))


def _reminder(
    to: str, tick: int, cells: tuple[int, ...], history: History
) -> wire.Reminder:
    """Return the message that tells a part the histories of some of its cells."""
    return wire.Reminder(
        to=to,
        tick=tick,
        length=history.length,
        cells=cells,
        on=wire.joined_rings([_packed(history.on[:, k]) for k in cells]),
        off=wire.joined_rings([_packed(history.off[:, k]) for k in cells]),
    )


def _packed(ring: Words) -> bytes:
    """Return a ring of bits, ``(W,)``, as bytes."""
    return ring.astype("<u8").tobytes()


def _cells_asked(recall: wire.Recall, cells: range) -> list[int]:
    """Return which of some cells are asked anything, ascending."""
    counted = [a for count in check_recall(recall) for a in count.literals]
    asked = np.unique(np.array((*recall.readings, *counted), np.int64))
    own: list[int] = np.unique(asked[_own(asked, cells)] >> 1).tolist()
    return own


def _own(literals: NDArray[np.intp], cells: range) -> NDArray[np.intp]:
    """Return the places of those literals that are of some cells."""
    sensors = literals >> 1
    places: NDArray[np.intp] = np.flatnonzero(
        (sensors >= cells.start) & (sensors < cells.stop)
    )
    return places
