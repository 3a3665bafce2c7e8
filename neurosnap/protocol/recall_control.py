"""The coordinator's questions to the histories of the cells, and their answers.

Pure: a question in, messages out; answers in, and once the last has come, what they
come to. One question is under way at a time. Cells that say they lack a history get it
from the coordinator, which keeps one for its key-frames, and are asked again. What is
asked follows from the question and from who lacked what, whatever the order in which
the answers came.
"""

from bisect import bisect_right
from collections.abc import Iterator

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import AnswerLostError, MessageError
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.search import Answer, Question, Weighed
from neurosnap.protocol.message_checks import check_rings
from neurosnap.protocol.part_history import cells_asked, packed, unpacked
from neurosnap.protocol.partition import hosts, shares

_REMINDED = 64  # cells in one message, at most
_CODES = (0, 1, 2, 3, 4, 8, 12)


class _Part:
    """What one part is asked, and has answered."""

    def __init__(self, name: str, cells: range, asked: list[int]) -> None:
        self.name = name
        self.cells = cells
        self.asked = asked
        self.answer: wire.Recalled | None = None


class RecallControl:
    """Asks the parts that have cells, and puts together what they answer.

    Args:
        sensors: How many cells there are.
        repeats: How often a question that is not answered is asked again.
        workers: How many workers share the cells; 0: every cell is a part of its own.
    """

    def __init__(self, sensors: int, repeats: int, workers: int) -> None:
        self._sensors = sensors
        self._repeats = repeats
        self._all_hear = workers > 0
        self._names = hosts(sensors, workers)
        self._hosted = shares(sensors, workers or sensors)
        self._recall: wire.Recall | None = None  # the question under way
        self._question = Question()
        self._parts: dict[str, _Part] = {}
        self._tick = self._round = 0  # of the last question
        self._tries = 0

    @property
    def recall(self) -> wire.Recall | None:
        """The question that is not answered yet."""
        return self._recall

    def cells_of(self, who: str) -> range:
        """Return the cells of a part; none, if it has none."""
        known = who in self._names
        return self._hosted[self._names.index(who)] if known else range(0)

    def remind(self, tick: int, cell: int, history: History) -> list[wire.Message]:
        """Return the message that tells a cell its history, up to a tick."""
        starts = [part.start for part in self._hosted]
        owner = bisect_right(starts, cell) - 1
        return [_reminder(self._names[owner], tick, (cell,), history)]

    def ask(self, tick: int, question: Question) -> list[wire.Message]:
        """Return the messages that ask the cells, about their readings up to a tick."""
        weighing = question.weighing
        if tick != self._tick:
            self._tick, self._round = tick, 0
        self._question, self._tries = question, 0
        recall = wire.Recall(
            tick=tick,
            round=1,
            readings=question.readings,
            within=wire.joined_rings([packed(one.within) for one in question.counts]),
            counted=b"".join(
                one.literals.astype("<i4").tobytes() for one in question.counts
            ),
            sizes=tuple(len(one.literals) for one in question.counts),
            sensors=0 if weighing is None else weighing.sensors,
            on=b"" if weighing is None else wire.joined_rings([packed(weighing.on)]),
            off=b"" if weighing is None else wire.joined_rings([packed(weighing.off)]),
            decay=0.0 if weighing is None else weighing.decay,
            share=0.0 if weighing is None else weighing.share,
        )
        return self._ask(recall)

    def _ask(self, recall: wire.Recall, repeats: int = 0) -> list[wire.Message]:
        """Begin a round in which everybody is asked that has cells it is about."""
        cells = cells_asked(recall, range(self._sensors))
        starts = np.array([part.start for part in self._hosted])
        owners = np.searchsorted(starts, cells, side="right") - 1
        self._parts = {}
        for owner, cell in zip(owners.tolist(), cells, strict=True):
            name, hosted = self._names[owner], self._hosted[owner]
            part = self._parts.setdefault(name, _Part(name, hosted, []))
            part.asked.append(cell)
        return self._begin(recall, repeats, cells)

    def _ask_lacking(self, recall: wire.Recall) -> list[wire.Message]:
        """Begin a round in which those are asked that lacked a history."""
        cells = []
        for part in self._parts.values():
            if part.answer is not None and part.answer.lacks:
                part.answer = None
                cells += part.asked
        return self._begin(recall, 0, cells)

    def _begin(
        self, recall: wire.Recall, repeats: int, cells: list[int]
    ) -> list[wire.Message]:
        self._round += 1
        self._tries += 1
        replace = msgspec.structs.replace
        self._recall = recall = replace(recall, round=self._round, repeats=repeats)
        if self._all_hear or 2 * len(cells) > self._sensors:
            return [recall]
        return [replace(recall, cell=cell) for cell in cells]

    def repeat(self) -> list[wire.Message]:
        """Give up the round under way and ask again.

        Raises:
            AnswerLostError: It was asked as often as allowed; the error names who has
                not answered.
        """
        recall = self._recall
        if recall is None:
            return []
        if self._tries > self._repeats:
            raise AnswerLostError(self._loss(recall))
        return self._ask(recall, repeats=recall.round)

    def _loss(self, recall: wire.Recall) -> str:
        silent = [one.name for one in self._parts.values() if one.answer is None]
        lacking = [
            one.name for one in self._parts.values() if one.answer and one.answer.lacks
        ]
        named = ", ".join((silent or lacking)[:10])
        more = f" and {len(silent) - 10} more" if len(silent) > 10 else ""
        return (
            f"recall {recall.round} (tick {recall.tick}): must be answered within its"
            f" deadline, got {self._tries} tries;"
            f" {'silent' if silent else 'without a history'}: {named}{more}"
        )

    def receive(
        self, answer: wire.Recalled, history: History
    ) -> Answer | list[wire.Message]:
        """Take in an answer. Return what all say, or what is to be sent.

        An answer of a round that was given up, or that came before, is dropped.

        Args:
            answer: Somebody's.
            history: What the coordinator has kept for those who lack theirs.

        Raises:
            MessageError: It cannot be right.
            AnswerLostError: As for `repeat`: cells lack what they were reminded of.
        """
        recall = self._recall
        here = answer.tick, answer.round
        if here > (self._tick, self._round):
            rule = f"must be to round {self._round} of tick {self._tick}"
            raise MessageError(f"recalled: {rule}, got {here[1]} of {here[0]}")
        if recall is None or here != (recall.tick, recall.round):
            return []
        part = self._parts.get(answer.who)
        if part is None:
            raise MessageError(f"recalled: must be asked, got {answer.who:.40}")
        self._check(answer, part, recall, history.length)
        part.answer = part.answer or answer
        if any(one.answer is None for one in self._parts.values()):
            return []
        reminders = list(self._reminders(recall.tick, history))
        if reminders:
            if self._tries > self._repeats + 1:
                raise AnswerLostError(self._loss(recall))
            return [*reminders, *self._ask_lacking(recall)]
        self._recall = None
        return self._whole(recall, history.length)

    def _reminders(self, tick: int, history: History) -> Iterator[wire.Reminder]:
        """Yield what those lack who have answered so."""
        order = {name: place for place, name in enumerate(self._names)}
        for who in sorted(self._parts, key=order.__getitem__):
            answer = self._parts[who].answer
            lacks = sorted(answer.lacks) if answer is not None else []
            for first in range(0, len(lacks), _REMINDED):
                cells = tuple(lacks[first : first + _REMINDED])
                yield _reminder(who, tick, cells, history)

    def _check(
        self, answer: wire.Recalled, part: _Part, recall: wire.Recall, length: int
    ) -> None:
        """Refuse an answer that does not fit the question.

        Raises:
            MessageError: It does not.
        """
        if answer.lacks:
            if len({*answer.lacks}) < len(answer.lacks) or {*answer.lacks} - {
                *part.asked
            }:
                rule = f"must lack histories of cells of {part.name} that were asked"
                raise MessageError(f"recalled: {rule}, got {answer.lacks}")
            return
        readings = len(_own(np.array(recall.readings, np.intp), part.cells))
        several = self._question.counts
        counted = sum(len(_own(one.literals, part.cells)) for one in several)
        weighed = max(0, min(part.cells.stop, recall.sensors) - part.cells.start)
        rings = wire.split_rings("recalled: readings", answer.readings, readings)
        check_rings("recalled", rings, length)
        counts = wire.numbers("recalled: counts", answer.counts)
        if len(counts) != counted:
            rule = f"must be of {counted} literals"
            raise MessageError(f"recalled: counts: {rule}, got {len(counts)}")
        if counts and not 0 <= min(counts) <= max(counts) <= length:
            rule = f"must be in 0..{length}"
            raise MessageError(f"recalled: counts: {rule}, got {counts[:10]}")
        if (len(answer.weights), len(answer.codes)) != (32 * weighed, weighed):
            rule = f"must be of {weighed} sensors"
            got = f"{len(answer.weights)} bytes, {len(answer.codes)} codes"
            raise MessageError(f"recalled: weights: {rule}, got {got}")
        weights = np.frombuffer(answer.weights, "<f8")
        if not np.isfinite(weights).all() or not set(answer.codes) <= set(_CODES):
            raise MessageError("recalled: weights: must be finite, with proper codes")

    def _whole(self, recall: wire.Recall, length: int) -> Answer:
        """Return what all parts say."""
        readings: dict[int, NDArray[np.uint64]] = {}
        counts = [
            np.zeros(len(one.literals), np.int64) for one in self._question.counts
        ]
        squares = np.zeros((4, recall.sensors))
        codes = np.zeros(recall.sensors, np.uint8)
        asked = np.array(recall.readings, np.intp)
        for part in self._parts.values():
            if (answer := part.answer) is None:
                continue
            cells = part.cells
            literals = asked[_own(asked, cells)].tolist()
            rings = wire.split_rings("recalled", answer.readings, len(literals))
            for literal, ring in zip(literals, rings, strict=True):
                readings[literal] = unpacked(ring, length)
            found, first = np.frombuffer(answer.counts, "<i4"), 0
            for count, one in zip(counts, self._question.counts, strict=True):
                own = _own(one.literals, cells)
                count[own] = found[first : first + len(own)]
                first += len(own)
            weights = np.frombuffer(answer.weights, "<f8").reshape(-1, 4)
            weighed = slice(cells.start, cells.start + len(weights))
            squares[:, weighed] = weights.T
            codes[weighed] = np.frombuffer(answer.codes, np.uint8)
        result = Weighed(squares, codes) if recall.sensors else None
        return Answer(readings, tuple(counts), result)


def _reminder(
    to: str, tick: int, cells: tuple[int, ...], history: History
) -> wire.Reminder:
    """Return the message that tells a part the histories of some of its cells."""
    return wire.Reminder(
        to=to,
        tick=tick,
        length=history.length,
        cells=cells,
        on=wire.joined_rings([packed(history.on[:, k]) for k in cells]),
        off=wire.joined_rings([packed(history.off[:, k]) for k in cells]),
    )


def _own(literals: NDArray[np.intp], cells: range) -> NDArray[np.intp]:
    """Return the places of those literals that are of some cells."""
    sensors = literals >> 1
    places: NDArray[np.intp] = np.flatnonzero(
        (sensors >= cells.start) & (sensors < cells.stop)
    )
    return places
