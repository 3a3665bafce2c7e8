"""Sends the cells their wirings, starts waves, and repeats waves that are late.

A wiring goes out as the change against what was told before; only what is wired whole
can have missed anything before. A cell that is a process is told of its own edges, and
a worker of those of all its cells.

A wave has settled once all of its credit is back, as `neurosnap.protocol.wave_settling`
counts it. One that is given up is repeated under a new number after every cell has got
its whole wiring again, because a change that was lost must not live on.

Pure: edges and reports in, messages out.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.protocol.ask_until_answered import Round
from neurosnap.protocol.wave_settling import Wave
from neurosnap.protocol.worker_edges import parted
from neurosnap.protocol.worker_shares import hosts, shares

_UNANNOUNCED = 64  # most waves in a row that are not announced to all cells
FRAME = 1 << 16
"""The most edges a message to a worker adds, and the most it drops: half a megabyte
each."""
Edges = NDArray[np.int64]
_TARGET = 0xFFFFFFFF


class WaveControl:
    """Sends the cells their wirings, starts waves, and tells when they have settled.

    Args:
        sensors: How many cells there are.
        repeats: How often a wave that does not settle is sent again.
        workers: How many workers share the cells; 0: every cell is a part by itself.

    Attributes:
        wiring: What the parts were told of their out-edges.
    """

    def __init__(self, sensors: int, repeats: int = 2, workers: int = 0) -> None:
        self._sensors = sensors
        self._repeats = repeats
        self.wiring = SentWiring(sensors, workers)
        self._fence = 0  # the last wave announced to all
        self._stale = True  # a wiring was sent since that wave; true at first
        self._next = 1
        self._flying: dict[int, Wave] = {}
        self._rounds: dict[int, Round[None]] = {}  # of those in flight

    @property
    def waves(self) -> int:
        """How many waves were started; the number of the newest."""
        return self._next - 1

    @property
    def in_flight(self) -> tuple[int, ...]:
        """The numbers of the waves that have not settled, oldest first."""
        return tuple(self._flying)

    def start_at(self, waves: int, epochs: tuple[int, ...]) -> None:
        """Continue after `waves` waves and wirings up to `epochs`.

        The next wiring goes to all parts, and whole: if no wave is in flight, these are
        the whole state.

        Raises:
            InvalidValueError: The epochs are of another number of workers.
        """
        self._next = waves + 1
        self.wiring.start_at(epochs)

    def rewire(self, edges: Edges) -> list[wire.Message]:
        """Return the messages of `SentWiring.rewire`; the next wave is their fence."""
        messages = self.wiring.rewire(edges)
        self._stale = self._stale or bool(messages)
        return messages

    def start(
        self,
        kind: wire.WaveKind,
        tick: int = 0,
        signal: tuple[int, ...] = (),
        repeats: int = 0,
        *,
        seeds: int = 0,
    ) -> list[wire.Message]:
        """Begin a wave; return the messages that start it.

        A state wave is announced to every cell. A wave of a few literals goes to their
        cells only, as long as the wirings in force were fenced by a wave announced to
        all; its time then does not depend on how many cells there are.

        Args:
            kind: As in the message.
            tick: The tick it belongs to.
            signal: The literals that fire; empty in a state wave.
            repeats: The number of the wave given up for this one.
            seeds: For a state wave without a signal, how many sensors' readings are
                known: exactly these cells fire at the start. 0: all are.

        Raises:
            InvalidValueError: A signal is empty, or names a literal twice: a wave of it
                would not settle.
        """
        if kind == "signal" and not 0 < len(set(signal)) == len(signal):
            rule = "must be one or more literals, each once"
            raise InvalidValueError("signal", rule, signal)
        seeds = len(signal) or seeds or self._sensors
        number = self._next
        self._next += 1
        wave = Wave(number, tick, kind, seeds, self._sensors, signal, repeats)
        self._flying[number] = wave
        again = self._rounds.pop(repeats, None)
        self._rounds[number] = Round("", self._repeats) if again is None else again
        below = min(self._flying)
        cells = sorted({literal >> 1 for literal in signal})
        # Cells learn from announcements alone which waves they may forget.
        late = number - self._fence > _UNANNOUNCED
        many = self.wiring.workers or 2 * len(cells) > self._sensors
        if kind == "state" or self._stale or late or many:
            self._fence, self._stale = number, False
            return [wave.start(below, number)]
        return [wave.start(below, self._fence, cell) for cell in cells]

    def report(self, report: wire.CellReport | wire.WorkerReport) -> Wave | None:
        """Count a report; return its wave if that has settled now.

        A report on a wave that was given up is dropped. A report computed with other
        edges than those in force is refused, and its credit is not counted: the wave
        misses its deadline, and is repeated after whole wirings.

        Raises:
            MessageError: The report cannot be right, or is by a wiring not in force.
        """
        cells = self.wiring.cells_of(report)
        wave = self._flying.get(report.wave)
        if wave is None:
            if report.wave >= self._next:
                rule = f"must be on a wave up to {self._next - 1}"
                raise MessageError(
                    f"{wire.topic(report.key)}: {rule}, got {report.wave}"
                )
            return None
        self.wiring.check_epoch(report)
        wave.report(report, cells)
        if not wave.is_settled:
            return None
        del self._flying[wave.number]
        del self._rounds[wave.number]
        return wave

    def repeat(self, number: int, signal: tuple[int, ...]) -> list[wire.Message]:
        """Give up wave `number` and send it again under a new number.

        Args:
            number: A wave in flight.
            signal: For a state wave, the literals observed: a cell that missed the
                observation still fires then.

        Raises:
            AnswerLostError: It was repeated as often as allowed; the error names the
                missing credit and the cells that owe a report.
        """
        wave = self._flying[number]
        signal = wave.signal or signal
        silent = self.wiring.named(wave.silent(signal, self.wiring.targets))
        lack = f"missing credit {float(wave.missing):.6g}, silent"
        self._rounds[number].what = f"wave {number} (tick {wave.tick})"
        self._rounds[number].ask_again(silent, lack, rule="settle")
        del self._flying[number]
        whole = self.wiring.rewire_whole()
        self._stale = True
        again = self.start(wave.kind, wave.tick, signal, number, seeds=wave.seeds)
        return [*whole, *again]


class SentWiring:
    """The edges of all cells, and those that each part has been told of.

    The edges are a list and not a matrix: a hundred thousand cells have a million of
    them, out of 40 thousand million pairs.

    Args:
        sensors: How many cells there are.
        workers: How many workers share them; 0: every cell is a part by itself.
        frame: The most edges a message to a worker adds, and the most it drops.

    Attributes:
        workers: As given.
        is_forgotten: Whether the next wiring goes to all, and whole.
    """

    def __init__(self, sensors: int, workers: int = 0, frame: int = FRAME) -> None:
        self.workers = workers
        self.is_forgotten = False
        self._parts = shares(sensors, workers or sensors)
        self._names = hosts(sensors, workers)
        # The literals at which those of each part begin, and where the last end.
        starts = [2 * cells.start for cells in self._parts]
        self._ends = np.array([*starts, 2 * sensors], np.int64)
        self._frame = frame
        self._edges = np.empty(0, np.int64)
        self._epoch = 0  # of the last wiring of any cell; workers count for themselves
        self._told = [0] * len(self._parts)  # epoch of each part's last wiring
        # Epochs at which a part has the edges in force: that of the last change, and of
        # each whole wiring since. A whole wiring changes the edges of no part that had
        # them, and may still be on its way. Between two frames of a wiring, a worker
        # has a part of them.
        self._in_force = [{0} for _ in self._parts]

    @property
    def epochs(self) -> tuple[int, ...]:
        """The numbers that go on when the rest is forgotten.

        That of the last wiring, whichever cell it was for, or of each worker's last.
        """
        return tuple(self._told) if self.workers else (self._epoch,)

    def start_at(self, epochs: tuple[int, ...]) -> None:
        """Continue after these epochs: the next wiring goes to all, and whole.

        Raises:
            InvalidValueError: They are of another number of workers.
        """
        if len(epochs) != len(self.epochs):
            rule = f"must be one for each of {self.workers} workers"
            rule = rule if self.workers else "must be one for all cells"
            raise InvalidValueError("epochs", rule, epochs)
        if self.workers:
            self._told = list(epochs)
        else:
            self._epoch = epochs[0]
        self.is_forgotten = True

    def rewire(self, edges: Edges) -> list[wire.Message]:
        """Return the messages that turn the wiring into `edges`. O(e + n) time.

        These are ``(e,)``, ascending, ``source << 32 | target`` each, and must not
        change afterwards.
        """
        before, self._edges = self._edges, edges
        if self.is_forgotten:
            # Also to parts without edges. Nothing is under way, and what begins next
            # begins behind it: a part that reports by another wiring has missed it.
            self.is_forgotten = False
            parts = list(range(len(self._parts)))
            messages = self._wire_whole(parts)
        else:
            gained, lost = _changes(before, edges)
            sources = np.concatenate((gained, lost)) >> 32
            found = np.searchsorted(self._ends, sources, side="right") - 1
            parts = sorted(set(found.tolist()))
            messages = []
            if parts:
                after = [self._told[part] for part in parts]
                messages = self._wire(parts, gained, lost, after)
        for part in parts:
            self._in_force[part] = {self._told[part]}
        return messages

    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of every part that has or had out-edges."""
        parts = [part for part, told in enumerate(self._told) if told]
        messages = self._wire_whole(parts)
        for part in parts:
            self._in_force[part].add(self._told[part])
        return messages

    def _wire_whole(self, parts: list[int]) -> list[wire.Message]:
        return self._wire(parts, self._edges, self._edges[:0], [0] * len(parts))

    def _wire(
        self, parts: list[int], gained: Edges, lost: Edges, after: list[int]
    ) -> list[wire.Message]:
        """Begin an epoch; tell parts what they gain and lose since another."""
        if not self.workers:
            return [*self._wire_cells(parts, gained, lost, after)]
        return [*self._wire_workers(parts, gained, lost, after)]

    def _wire_cells(
        self, cells: list[int], gained: Edges, lost: Edges, after: list[int]
    ) -> Iterator[wire.Message]:
        self._epoch += 1
        add, drop = _listed(gained, cells), _listed(lost, cells)
        for cell, since, more, less in zip(cells, after, add, drop, strict=True):
            self._told[cell] = self._epoch
            changes = more[0], less[0], more[1], less[1]
            yield wire.Wiring(cell, self._epoch, since, *changes)

    def _wire_workers(
        self, workers: list[int], gained: Edges, lost: Edges, after: list[int]
    ) -> Iterator[wire.Message]:
        """Yield frames, one a worker at least, each built on the one before."""
        gains = np.searchsorted(gained, self._ends << 32)
        losses = np.searchsorted(lost, self._ends << 32)
        for worker, since in zip(workers, after, strict=True):
            more = gained[gains[worker] : gains[worker + 1]]
            less = lost[losses[worker] : losses[worker + 1]]
            for start in range(0, max(len(more), len(less), 1), self._frame):
                frame = slice(start, start + self._frame)
                self._told[worker] += 1
                yield wire.WorkerWiring(
                    worker=worker,
                    epoch=self._told[worker],
                    after=since,
                    add=parted(more[frame]).astype("<i4").tobytes(),
                    drop=parted(less[frame]).astype("<i4").tobytes(),
                )
                since = self._told[worker]

    def targets(self, literal: int) -> Sequence[int]:
        """Return the targets of a literal, ascending."""
        start, stop = np.searchsorted(self._edges, (literal << 32, literal + 1 << 32))
        found: list[int] = (self._edges[start:stop] & _TARGET).tolist()
        return found

    def cells_of(self, report: wire.CellReport | wire.WorkerReport) -> range:
        """Return the cells that a report speaks for.

        Raises:
            MessageError: There is no such part.
        """
        by_worker = isinstance(report, wire.WorkerReport)
        if by_worker != bool(self.workers) or _part(report) >= len(self._parts):
            kind = "a worker's" if self.workers else "a cell's"
            got = report.sender.replace("/", " ")
            raise MessageError(f"{wire.topic(report.key)}: must be {kind}, got {got}")
        return self._parts[_part(report)]

    def check_epoch(self, report: wire.CellReport | wire.WorkerReport) -> None:
        """Refuse a report by edges that the part had before, in part, or never.

        Raises:
            MessageError: A wiring was lost, or is on its way still.
        """
        part = _part(report)
        if report.epoch not in self._in_force[part]:
            rule = f"must be by the wiring in force, of epoch {self._told[part]}"
            got = f"epoch {report.epoch} from {report.sender.replace('/', ' ')}"
            raise MessageError(f"{wire.topic(report.key)}: {rule}, got {got}")

    def named(self, cells: Sequence[int]) -> list[str]:
        """Return the names of the parts that have `cells`."""
        owners = np.searchsorted(self._ends, 2 * np.array(cells), side="right") - 1
        return [self._names[part] for part in np.unique(owners).tolist()]


def _part(report: wire.CellReport | wire.WorkerReport) -> int:
    return report.worker if isinstance(report, wire.WorkerReport) else report.cell


def _changes(before: Edges, after: Edges) -> tuple[Edges, Edges]:
    """Return the edges gained and lost, ascending. O(e) time."""
    # Of two ascending lists a stable sort makes one by merging them.
    both = np.sort(np.concatenate((before, after)), kind="stable")
    differs = np.ones(len(both) + 1, np.bool_)  # from the one before
    differs[1:-1] = both[1:] != both[:-1]
    once = both[differs[:-1] & differs[1:]]
    gained = np.searchsorted(after, once) < np.searchsorted(after, once, "right")
    return once[gained], once[~gained]


def _listed(
    edges: Edges, cells: list[int]
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Yield the targets of the two literals of each cell, ascending."""
    literals = 2 * np.array(cells, np.int64)[:, None] + np.arange(3)
    ends: list[list[int]] = np.searchsorted(edges, literals << 32).tolist()
    targets = (edges & _TARGET).tolist()
    for own, complement, stop in ends:
        yield tuple(targets[own:complement]), tuple(targets[complement:stop])
