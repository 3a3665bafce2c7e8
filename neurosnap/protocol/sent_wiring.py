"""Wiring of single cells: changes of out-edges, as messages.

A wiring goes out as the change against what was told before; only what is wired whole
can have missed anything before.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.poc.order.literals import Words, from_words, to_words


class Wires(Protocol):
    """The edges of all cells, and who has to be told of them."""

    @property
    def all_hear(self) -> bool:
        """Whether every wave is announced to all: there are few who have to hear."""
        ...

    @property
    def epochs(self) -> tuple[int, ...]:
        """The numbers that go on when the rest is forgotten."""
        ...

    @property
    def is_forgotten(self) -> bool:
        """Whether the next wiring goes to all, and whole."""
        ...

    def forget(self) -> None:
        """Let the next wiring go to all, and whole, whatever they were told."""
        ...

    def start_at(self, epochs: tuple[int, ...]) -> None:
        """Be as whoever had these `epochs` and forgot.

        Raises:
            InvalidValueError: They are of another number of workers.
        """
        ...

    def rewire(self, wires: Words) -> list[wire.Message]:
        """Return the messages that turn the wiring into `wires`.

        Args:
            wires: ``(2N, w)``, packed: bit ``b`` of row ``a`` iff ``a`` pulses ``b``.
        """
        ...

    def rewire_to(self, edges: NDArray[np.int64]) -> list[wire.Message]:
        """Return the messages that turn the wiring into `edges`.

        Args:
            edges: ``(e,)``, ascending, as `neurosnap.protocol.worker_edges.joined` has
            them.
        """
        ...

    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of everybody who has or had out-edges."""
        ...

    def targets(self, literal: int) -> Sequence[int]:
        """Return the targets of a literal, ascending."""
        ...

    def cells_of(self, report: wire.CellReport | wire.WorkerReport) -> range:
        """Return the cells that a report speaks for.

        Raises:
            MessageError: There is nobody here to send it.
        """
        ...

    def check_epoch(
        self, report: wire.CellReport | wire.WorkerReport, cells: range
    ) -> None:
        """Refuse a report of somebody whose edges were not those in force.

        That of the last wiring is not the only epoch that does: a wiring sent whole to
        all changes the edges of nobody who had them, and may still be on its way.

        Args:
            report: Of somebody here.
            cells: By `cells_of`.

        Raises:
            MessageError: A wiring was lost, or is on its way still.
        """
        ...

    def named(self, cells: Sequence[int]) -> list[str]:
        """Return whom it takes to hear from `cells`, as text."""
        ...


class CellWires:
    """Every cell is a part of its own and is told of its own edges.

    Args:
        sensors: How many cells there are.
    """

    all_hear = False

    def __init__(self, sensors: int) -> None:
        self._wires = to_words(np.zeros((2 * sensors, 2 * sensors), np.bool_))
        self._epoch = 0
        self._told = [0] * sensors  # epoch of each cell's last wiring
        self._changed = [0] * sensors  # and of the last that changed its edges
        self.is_forgotten = False

    @property
    def epochs(self) -> tuple[int, ...]:
        """The number of the last wiring, whichever cell it was for."""
        return (self._epoch,)

    def forget(self) -> None:
        """Let the next wiring go to all cells, and whole."""
        self.is_forgotten = True

    def start_at(self, epochs: tuple[int, ...]) -> None:
        """Be as whoever had these `epochs` and forgot."""
        if len(epochs) != 1:
            raise InvalidValueError("epochs", "must be one for all cells", epochs)
        self._epoch = epochs[0]
        self.is_forgotten = True

    def rewire(self, wires: Words) -> list[wire.Message]:
        """Return what the cells that change are told; 64 edges are compared at once."""
        if self.is_forgotten:
            return self._rewire_all(wires)
        flips = self._wires ^ wires
        changed = np.flatnonzero(flips.any(axis=1))
        cells = sorted({literal >> 1 for literal in changed.tolist()})
        if not cells:
            return []
        self._wires ^= flips
        after = [self._told[cell] for cell in cells]
        wirings = self._wirings(cells, flips, after)
        for cell in cells:
            self._changed[cell] = self._epoch
        return wirings

    def _rewire_all(self, wires: Words) -> list[wire.Message]:
        """Return the whole wiring of every cell, also of those without edges.

        Nothing is under way, and what begins next begins behind it: whoever reports by
        another has missed it.
        """
        self.is_forgotten = False
        self._wires = wires.copy()
        cells = list(range(len(self._told)))
        wirings = self._wirings(cells, self._wires, [0] * len(cells))
        self._changed = self._told.copy()
        return wirings

    def rewire_to(self, edges: NDArray[np.int64]) -> list[wire.Message]:
        """Return what the cells that change are told. O(N²) time and memory."""
        literals = len(self._wires)
        wired = np.zeros((literals, literals), np.bool_)
        wired[edges >> 32, edges & 0xFFFFFFFF] = True
        return self.rewire(to_words(wired))

    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of every cell that has or had out-edges."""
        cells = [cell for cell, told in enumerate(self._told) if told]
        return self._wirings(cells, self._wires, [0] * len(cells))

    def targets(self, literal: int) -> Sequence[int]:
        """Return the targets of a literal, ascending."""
        return _listed(self._wires[[literal]])[0]

    def cells_of(self, report: wire.CellReport | wire.WorkerReport) -> range:
        """Return the one cell that a report speaks for."""
        if isinstance(report, wire.WorkerReport) or report.cell >= len(self._told):
            raise MessageError(
                f"{wire.topic(report.key)}: must be a cell's, got {_sender(report)}"
            )
        return range(report.cell, report.cell + 1)

    def check_epoch(
        self, report: wire.CellReport | wire.WorkerReport, cells: range
    ) -> None:
        """Refuse a cell's report by edges it had before, or never."""
        cell = cells.start
        if not self._changed[cell] <= report.epoch <= self._told[cell]:
            raise outdated(report, self._told[cell])

    def named(self, cells: Sequence[int]) -> list[str]:
        """Return the cells' own names."""
        return [f"cell/{cell}" for cell in cells]

    def _wirings(
        self, cells: list[int], flips: Words, after: list[int]
    ) -> list[wire.Message]:
        """Begin an epoch; say which of `flips` the cells now have, and which not."""
        self._epoch += 1
        own = 2 * np.repeat(np.array(cells, np.intp), 2)
        own[1::2] += 1
        add = _listed(flips[own] & self._wires[own])
        drop = _listed(flips[own] & ~self._wires[own])
        messages: list[wire.Message] = []
        for place, cell in enumerate(cells):
            self._told[cell] = self._epoch
            messages.append(
                wire.Wiring(
                    cell=cell,
                    epoch=self._epoch,
                    after=after[place],
                    add=add[2 * place],
                    drop=drop[2 * place],
                    add_complement=add[2 * place + 1],
                    drop_complement=drop[2 * place + 1],
                )
            )
        return messages


def outdated(report: wire.CellReport | wire.WorkerReport, told: int) -> MessageError:
    """Return the error for a report by other edges than those of epoch `told`."""
    rule = f"must be by the wiring in force, of epoch {told}"
    got = f"got epoch {report.epoch} from {_sender(report)}"
    return MessageError(f"{wire.topic(report.key)}: {rule}, {got}")


def members(sets: Words) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the number of a packed set and a literal in it, for each there is.

    Args:
        sets: ``(k, w)``.

    Returns:
        ``(m,)`` each, ascending by set, then by literal. O(k w + m) time.
    """
    # A set has few literals: only words that hold some are taken apart.
    owners, words = sets.nonzero()
    found, bits = from_words(sets[owners, words][:, None], 64).nonzero()
    return owners[found], 64 * words[found] + bits


def _listed(sets: Words) -> list[tuple[int, ...]]:
    """Return the literals of each packed set, ascending."""
    owners, literals = members(sets)
    listed = literals.tolist()
    ends = np.searchsorted(owners, np.arange(len(sets) + 1)).tolist()
    return [tuple(listed[start:end]) for start, end in pairwise(ends)]


def _sender(report: wire.CellReport | wire.WorkerReport) -> str:
    return report.sender.replace("/", " ")
