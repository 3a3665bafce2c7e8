"""The last readings of many cells as arrays, and what is answered from them.

What a worker answers for its cells is what each of them would answer, see
`neurosnap.protocol.cell_history`; and a replay derives either from the readings.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.search import Count, Question
from neurosnap.poc.order.literals import Words
from neurosnap.protocol.cell_history import check_recall, check_reminder


def packed(ring: Words) -> bytes:
    """Return a ring of bits, ``(W,)``, as bytes."""
    return ring.astype("<u8").tobytes()


def unpacked(data: bytes, length: int) -> Words:
    """Return a ring of bits, ``(length / 64,)``; what is beyond is left out."""
    padded = data[: length // 8].ljust(length // 8, b"\0")
    return np.frombuffer(padded, "<u8").astype(np.uint64)


class WorkerHistory:
    """The histories of a worker's cells: those that it was asked for.

    Args:
        worker: Its number.
        cells: Its cells.
    """

    def __init__(self, worker: int, cells: range) -> None:
        self._who = f"worker/{worker}"
        self._cells = cells
        self._history: History | None = None
        self._held = np.zeros(len(cells), np.bool_)  # which cells have theirs

    def observe(
        self, tick: int, bits: NDArray[np.bool_], known: NDArray[np.bool_] | None
    ) -> None:
        """Add what the worker's cells read at a tick. O(cells) time."""
        history = self._history
        if history is None or tick <= history.tick:
            return
        if tick > history.tick + 1:
            self._history = None
            self._held[:] = False
        else:
            history.record(bits, known)

    def remember(self, reminder: wire.Reminder) -> None:
        """Take over the histories that the coordinator has.

        Raises:
            MessageError: They cannot be right.
        """
        rings = check_reminder(reminder, self._who, self._cells)
        history = self._history
        if history is not None and reminder.tick < history.tick:
            return
        if history is None or (reminder.tick, reminder.length) != (
            history.tick,
            history.length,
        ):
            history = self._history = History(len(self._cells), reminder.length)
            history.tick = reminder.tick
            self._held[:] = False
        for cell, on, off in rings:
            place = cell - self._cells.start
            both = unpacked(on, history.length), unpacked(off, history.length)
            history.set_readings(place, *both)
            self._held[place] = True

    def answer(self, recall: wire.Recall) -> list[wire.Message]:
        """Answer a question, if any cell is asked anything.

        Raises:
            MessageError: It cannot be right.
        """
        asked = cells_asked(recall, self._cells)
        history = self._history
        if not asked or (history is not None and recall.tick < history.tick):
            return []
        if history is None or recall.tick > history.tick:
            lacks = asked
        else:
            lacks = [cell for cell in asked if not self._held[cell - self._cells.start]]
        if history is None or lacks:
            here = self._who, recall.tick, recall.round
            return [wire.Recalled(*here, lacks=tuple(lacks))]
        return [answer_of(self._who, recall, history, self._cells)]


def cells_asked(recall: wire.Recall, cells: range) -> list[int]:
    """Return which of some cells are asked anything, ascending.

    Raises:
        MessageError: The question cannot be right.
    """
    counted = [a for count in check_recall(recall) for a in count.literals]
    several = np.unique(np.array((*recall.readings, *counted), np.int64) >> 1)
    own = several[(several >= cells.start) & (several < cells.stop)]
    found: list[int] = own.tolist()
    return found


def answer_of(
    who: str, recall: wire.Recall, history: History, cells: range
) -> wire.Recalled:
    """Return what a part answers to a question.

    Args:
        who: Its name.
        recall: The question.
        history: That of its cells, and of no other.
        cells: Its cells.

    Raises:
        MessageError: The question cannot be right.
    """
    first, length = 2 * cells.start, history.length

    def own(literals: Sequence[int]) -> NDArray[np.intp]:
        here = np.array(literals, np.intp) - first
        return here[(here >= 0) & (here < 2 * len(cells))]

    counts = tuple(
        Count(unpacked(count.within, length), own(count.literals))
        for count in check_recall(recall)
    )
    readings = tuple(own(recall.readings).tolist())
    answer = history.answer(Question(readings, counts))
    return wire.Recalled(
        who=who,
        tick=recall.tick,
        round=recall.round,
        readings=wire.joined_rings([packed(answer.readings[a]) for a in readings]),
        counts=b"".join(found.astype("<i4").tobytes() for found in answer.counts),
    )
