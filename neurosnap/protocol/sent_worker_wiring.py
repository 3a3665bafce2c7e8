"""Wiring of workers: changes of their cells' out-edges, as messages.

The edges are a list and not a matrix: a hundred thousand cells have a million of them,
out of 40 thousand million pairs.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.poc.order.kernels import pairs
from neurosnap.poc.order.literals import Words
from neurosnap.protocol.partition import shares
from neurosnap.protocol.sent_wiring import outdated
from neurosnap.protocol.worker_edges import parted

FRAME = 1 << 16
"""The most edges a message adds, and the most it drops: half a megabyte each."""


class WorkerWires:
    """Every worker is told of the edges of all its cells; see `Wires`.

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
        self.is_forgotten = False

    @property
    def epochs(self) -> tuple[int, ...]:
        """The number of each worker's last frame."""
        return tuple(self._told)

    def forget(self) -> None:
        """Let the next wiring go to all workers, and whole."""
        self.is_forgotten = True

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
