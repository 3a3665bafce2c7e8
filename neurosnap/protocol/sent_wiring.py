"""What cells and workers were told of their out-edges, and the messages that change it.

A wiring goes out as the change against what was told before; only what is wired whole
can have missed anything before. Cells that are processes are told one by one, and
workers of all their cells.
"""

import abc
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.poc.order.kernels import pairs
from neurosnap.poc.order.literals import Words, from_words, to_words
from neurosnap.protocol.partition import shares
from neurosnap.protocol.worker_edges import parted

FRAME = 1 << 16
"""The most edges a message adds, and the most it drops: half a megabyte each."""


class Wires(abc.ABC):
    """The edges of all cells, and who has to be told of them."""

    all_hear: ClassVar[bool]
    """Whether every wave is announced to all: there are few who have to hear."""
    is_forgotten = False
    """Whether the next wiring goes to all, and whole."""

    def forget(self) -> None:
        """Let the next wiring go to all, and whole, whatever they were told."""
        self.is_forgotten = True

    @property
    @abc.abstractmethod
    def epochs(self) -> tuple[int, ...]:
        """The numbers that go on when the rest is forgotten."""

    @abc.abstractmethod
    def start_at(self, epochs: tuple[int, ...]) -> None:
        """Be as whoever had these `epochs` and forgot.

        Raises:
            InvalidValueError: They are of another number of workers.
        """

    @abc.abstractmethod
    def rewire(self, wires: Words) -> list[wire.Message]:
        """Return the messages that turn the wiring into `wires`.

        Args:
            wires: ``(2N, w)``, packed: bit ``b`` of row ``a`` iff ``a`` pulses ``b``.
        """

    @abc.abstractmethod
    def rewire_to(self, edges: NDArray[np.int64]) -> list[wire.Message]:
        """Return the messages that turn the wiring into `edges`.

        Args:
            edges: ``(e,)``, ascending, as `neurosnap.protocol.worker_edges.joined` has
            them.
        """

    @abc.abstractmethod
    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of everybody who has or had out-edges."""

    @abc.abstractmethod
    def targets(self, literal: int) -> Sequence[int]:
        """Return the targets of a literal, ascending."""

    @abc.abstractmethod
    def cells_of(self, report: wire.CellReport | wire.WorkerReport) -> range:
        """Return the cells that a report speaks for.

        Raises:
            MessageError: There is nobody here to send it.
        """

    @abc.abstractmethod
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

    @abc.abstractmethod
    def named(self, cells: Sequence[int]) -> list[str]:
        """Return whom it takes to hear from `cells`, as text."""


class CellWires(Wires):
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

    @property
    def epochs(self) -> tuple[int, ...]:
        """The number of the last wiring, whichever cell it was for."""
        return (self._epoch,)

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


class WorkerWires(Wires):
    """Every worker is told of the edges of all its cells.

    The edges are a list and not a matrix: a hundred thousand cells have a million of
    them, out of 40 thousand million pairs.

    Args:
        sensors: How many cells there are.
        workers: How many workers share them.
        frame: The most edges a message adds, and the most it drops.
    """

    all_hear = True

    def __init__(self, sensors: int, workers: int, frame: int = FRAME) -> None:
        self._hosted = shares(sensors, workers)
        self._frame = frame
        self._edges = np.empty(0, np.int64)
        self._told = [0] * workers  # epoch of each worker's last frame
        # Epochs at which a worker has the edges in force: the last frame of the last
        # change, and of each whole wiring since. Between, it has a part of them.
        self._in_force = [{0} for _ in range(workers)]

    @property
    def epochs(self) -> tuple[int, ...]:
        """The number of each worker's last frame."""
        return tuple(self._told)

    def start_at(self, epochs: tuple[int, ...]) -> None:
        """Be as whoever had these `epochs` and forgot."""
        if len(epochs) != len(self._told):
            rule = f"must be one for each of {len(self._told)} workers"
            raise InvalidValueError("epochs", rule, epochs)
        self._told = list(epochs)
        self.is_forgotten = True

    def rewire(self, wires: Words) -> list[wire.Message]:
        """Return what the workers whose cells change are told."""
        count = int(np.bitwise_count(wires).sum())
        return self.rewire_to(pairs(wires, count))

    def rewire_to(self, edges: NDArray[np.int64]) -> list[wire.Message]:
        """Return what the workers whose cells change are told. O(e) time."""
        if self.is_forgotten:
            return self._rewire_all(edges)
        gained = np.setdiff1d(edges, self._edges, assume_unique=True)
        lost = np.setdiff1d(self._edges, edges, assume_unique=True)
        self._edges = edges.copy()
        wirings: list[wire.Message] = []
        for worker, told in enumerate(self._told):
            gains, losses = self._own(worker, gained), self._own(worker, lost)
            wirings += self._wirings(worker, gains, losses, told)
            if self._told[worker] != told:
                self._in_force[worker] = {self._told[worker]}
        return wirings

    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of every worker whose cells have or had out-edges."""
        wirings: list[wire.Message] = []
        for worker, told in enumerate(self._told):
            if told:
                wirings += self._whole(worker)
                self._in_force[worker].add(self._told[worker])
        return wirings

    def _rewire_all(self, edges: NDArray[np.int64]) -> list[wire.Message]:
        """Return the whole wiring of every worker, also of those without edges.

        Nothing is under way, and what begins next begins behind it: whoever reports by
        another has missed it.
        """
        self.is_forgotten = False
        self._edges = edges.copy()
        wirings: list[wire.Message] = []
        for worker in range(len(self._told)):
            wirings += self._whole(worker)
            self._in_force[worker] = {self._told[worker]}
        return wirings

    def _whole(self, worker: int) -> Iterator[wire.Message]:
        edges = self._own(worker, self._edges)
        return self._wirings(worker, edges, edges[:0], 0, least=1)

    def targets(self, literal: int) -> Sequence[int]:
        """Return the targets of a literal, ascending."""
        start, stop = np.searchsorted(self._edges, (literal << 32, literal + 1 << 32))
        found: list[int] = (self._edges[start:stop] & 0xFFFFFFFF).tolist()
        return found

    def cells_of(self, report: wire.CellReport | wire.WorkerReport) -> range:
        """Return the cells of the worker whose report it is."""
        if isinstance(report, wire.CellReport) or report.worker >= len(self._hosted):
            got = report.sender.replace("/", " ")
            raise MessageError(
                f"{wire.topic(report.key)}: must be a worker's, got {got}"
            )
        return self._hosted[report.worker]

    def check_epoch(
        self, report: wire.CellReport | wire.WorkerReport, cells: range
    ) -> None:
        """Refuse a worker's report by edges it had before, in part, or never."""
        worker = self._hosted.index(cells)
        if report.epoch not in self._in_force[worker]:
            raise outdated(report, self._told[worker])

    def named(self, cells: Sequence[int]) -> list[str]:
        """Return the names of the workers, and how many of `cells` each has."""
        ends = [hosted.stop for hosted in self._hosted]
        owners = np.searchsorted(ends, np.array(cells, np.int64), side="right")
        workers, counts = np.unique(owners, return_counts=True)
        return [
            f"{count} of worker/{worker}"
            for worker, count in zip(workers.tolist(), counts.tolist(), strict=True)
        ]

    def _own(self, worker: int, edges: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return those of `edges` that lead from a worker's cells."""
        cells = self._hosted[worker]
        ends = (2 * cells.start << 32, 2 * cells.stop << 32)
        start, stop = np.searchsorted(edges, ends)
        return edges[start:stop]

    def _wirings(
        self,
        worker: int,
        gained: NDArray[np.int64],
        lost: NDArray[np.int64],
        after: int,
        least: int = 0,
    ) -> Iterator[wire.Message]:
        """Yield frames, each built on the one before; `least` at least."""
        most = max(len(gained), len(lost), least)
        for start in range(0, most, self._frame):
            frame = slice(start, start + self._frame)
            self._told[worker] += 1
            yield wire.WorkerWiring(
                worker=worker,
                epoch=self._told[worker],
                after=after,
                add=parted(gained[frame]).astype("<i4").tobytes(),
                drop=parted(lost[frame]).astype("<i4").tobytes(),
            )
            after = self._told[worker]


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
