"""The edges and incoming pulses of a worker's cells.

Nothing gets in here that names a cell where it does not belong.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import DEEPEST
from neurosnap.protocol.worker_kernels import Ints, Net, Pulses


class WorkerEdges:
    """The out-edges of one worker's cells, and checks of the pulses that reach them.

    Args:
        hosted: The cells of every worker, ascending, without a gap.
        worker: Whose edges these are.
    """

    def __init__(self, hosted: Sequence[range], worker: int) -> None:
        self._worker = worker
        self._hosted = hosted
        self._first = 2 * hosted[worker].start
        self._stop = 2 * hosted[worker].stop
        self._literals = 2 * hosted[-1].stop
        self._ends = np.array([2 * cells.stop for cells in hosted])
        self._edges = np.empty(0, np.int64)  # see `joined`; ascending
        self._net: Net | None = None

    def check(self, wiring: wire.WorkerWiring) -> None:
        """Refuse a frame that cannot be right.

        Raises:
            MessageError: It is for another worker, or holds a part of an edge, an edge
                twice or out of order, or one that leads from another's cell or to
                none.
        """
        if wiring.worker != self._worker:
            raise MessageError(
                f"workerwiring: must be for this worker, got {wiring.worker}"
            )
        for name, data in (
            ("workerwiring: add", wiring.add),
            ("workerwiring: drop", wiring.drop),
        ):
            edges = pairs(name, data)
            if (np.diff(joined(edges)) <= 0).any():
                raise MessageError(f"{name} must be ascending, got a step that is not")
            sources, targets = edges.T
            for what, field, first, stop in (
                ("from", sources, self._first, self._stop),
                ("to", targets, 0, self._literals),
            ):
                if len(field) and (field.min() < first or field.max() >= stop):
                    got = f"{field.min()} to {field.max()}"
                    raise MessageError(
                        f"{name} must lead {what} {first} to {stop - 1}, got {got}"
                    )

    def change(self, wiring: wire.WorkerWiring) -> None:
        """Apply a frame that `check` lets pass. O(e + k log e) time."""
        edges = self._edges if wiring.after else self._edges[:0]
        drop = joined(pairs("drop", wiring.drop))
        places, there = _found(edges, drop)
        edges = np.delete(edges, places[there])
        add = joined(pairs("add", wiring.add))
        places, there = _found(edges, add)
        self._edges = np.insert(edges, places[~there], add[~there])
        self._net = None

    def pulses(self, batch: wire.PulseBatch) -> Pulses:
        """Return the pulses in a batch.

        Raises:
            MessageError: They cannot be right: they are for another worker or from none
                of the others, not whole, or of cells that are not theirs.
        """
        if batch.to != self._worker:
            raise MessageError(f"pulsebatch: must be for this worker, got {batch.to}")
        if batch.worker == self._worker or batch.worker >= len(self._hosted):
            raise MessageError(
                f"pulsebatch: must be another worker's, got {batch.worker}"
            )
        pulses = Pulses(
            ints("pulsebatch: sources", batch.sources),
            ints("pulsebatch: targets", batch.targets),
            ints("pulsebatch: hops", batch.hops),
            ints("pulsebatch: credit", batch.credit),
        )
        sizes = {len(field) for field in pulses}
        if len(sizes) > 1 or 0 in sizes:
            raise MessageError(f"pulsebatch: must be whole pulses, got {sorted(sizes)}")
        theirs = self._hosted[batch.worker]
        for name, field, least, most in (
            ("sources", pulses.sources, 2 * theirs.start, 2 * theirs.stop - 1),
            ("targets", pulses.targets, self._first, self._stop - 1),
            ("hops", pulses.hops, 1, DEEPEST),
            ("credit", pulses.credit, 0, DEEPEST),
        ):
            if field.min() < least or field.max() > most:
                rule = f"must be {least} to {most}"
                got = f"{field.min()} to {field.max()}"
                raise MessageError(f"pulsebatch: {name} {rule}, got {got}")
        return pulses

    @property
    def net(self) -> Net:
        """All edges. O(e + n) time after a change."""
        if self._net is None:
            places = np.arange(self._first, self._stop + 1) << 32
            targets = self._edges & 0xFFFFFFFF
            owners = np.searchsorted(self._ends, targets, side="right")
            self._net = Net(
                self._first,
                np.searchsorted(self._edges, places),
                targets.astype(np.int32),
                owners.astype(np.int32),
            )
        return self._net


def ints(name: str, data: bytes) -> Ints:
    """Return what `neurosnap.wire.numbers` does, as a read-only ``(k,)`` array."""
    if len(data) % 4:
        raise MessageError(f"{name}: must be four bytes a number, got {len(data)}")
    return np.frombuffer(data, "<i4")


def pairs(name: str, data: bytes) -> Ints:
    """Return a field of edges as ``(e, 2)``, source and target.

    Raises:
        MessageError: There is a part of an edge in it.
    """
    if len(data) % 8:
        raise MessageError(f"{name}: must be eight bytes an edge, got {len(data)}")
    return ints(name, data).reshape(-1, 2)


def joined(edges: Ints) -> NDArray[np.int64]:
    """Return edges, ``(e, 2)``, as numbers, ``(e,)``, that sort as they do.

    The source is above the 32nd bit, the target below.
    """
    return edges[:, 0].astype(np.int64) << 32 | edges[:, 1]


def parted(edges: NDArray[np.int64]) -> Ints:
    """Undo `joined`: return the edges as ``(e, 2)``."""
    return np.stack((edges >> 32, edges & 0xFFFFFFFF), axis=1).astype(np.int32)


def _found(
    edges: NDArray[np.int64], wanted: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return where each wanted edge is or belongs, and whether it is there."""
    places = np.searchsorted(edges, wanted)
    there = np.zeros(len(wanted), np.bool_)
    inside = places < len(edges)
    there[inside] = edges[places[inside]] == wanted[inside]
    return places, there
