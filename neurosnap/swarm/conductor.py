"""What the coordinator keeps of the network: every cell's wiring, every wave in flight.

Pure: edges and reports in, messages out. A wiring goes out as the change against what
the cell was told before; a wave that is given up is repeated under a new number after
every cell has got its whole wiring again, because a change that was lost must not live
on.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, WaveLostError
from neurosnap.swarm.wave import Wave

_UNANNOUNCED = 64  # waves that only concern a few, before all cells hear of one again


class Conductor:
    """Wires the cells and counts the waves in.

    Args:
        sensors: How many cells there are.
        repeats: How often a wave that does not settle is sent again.
    """

    def __init__(self, sensors: int, repeats: int = 2) -> None:
        self._sensors = sensors
        self._repeats = repeats
        self._edges = np.zeros((2 * sensors, 2 * sensors), dtype=np.bool_)
        self._epoch = 0
        self._told = [0] * sensors  # epoch of each cell's last wiring
        self._fence = 0  # the last wave announced to all
        self._stale = True  # a wiring went out since, or many waves
        self._next = 1
        self._flying: dict[int, Wave] = {}
        self._tries: dict[int, int] = {}

    @property
    def waves(self) -> int:
        """How many waves were started; the number of the newest."""
        return self._next - 1

    @property
    def in_flight(self) -> tuple[int, ...]:
        """The numbers of the waves that have not settled, oldest first."""
        return tuple(self._flying)

    def rewire(self, edges: NDArray[np.bool_]) -> list[wire.Message]:
        """Return the messages that turn the cells' wiring into `edges`.

        Args:
            edges: ``(2N, 2N)``; ``edges[a, b]`` iff ``a`` pulses ``b``.
        """
        changed = np.flatnonzero((edges != self._edges).any(axis=1))
        cells = sorted({int(literal) >> 1 for literal in changed})
        if not cells:
            return []
        self._epoch += 1
        self._stale = True
        messages: list[wire.Message] = [
            self._wiring(cell, edges, self._told[cell]) for cell in cells
        ]
        self._edges = edges.copy()
        return messages

    def rewire_whole(self) -> list[wire.Message]:
        """Return the whole wiring of every cell that has or had out-edges."""
        self._epoch += 1
        self._stale = True
        return [
            self._wiring(cell, self._edges, 0)
            for cell in range(self._sensors)
            if self._told[cell]
        ]

    def _wiring(self, cell: int, edges: NDArray[np.bool_], after: int) -> wire.Wiring:
        def literals(row: NDArray[np.bool_]) -> tuple[int, ...]:
            return tuple(np.flatnonzero(row).tolist())

        own, complement = 2 * cell, 2 * cell + 1
        old, new = self._edges[[own, complement]], edges[[own, complement]]
        if not after:
            old = np.zeros_like(old)
        self._told[cell] = self._epoch
        return wire.Wiring(
            cell=cell,
            epoch=self._epoch,
            after=after,
            add=literals(new[0] & ~old[0]),
            drop=literals(old[0] & ~new[0]),
            add_complement=literals(new[1] & ~old[1]),
            drop_complement=literals(old[1] & ~new[1]),
        )

    def start(
        self,
        kind: wire.WaveKind,
        tick: int = 0,
        signal: tuple[int, ...] = (),
        repeats: int = 0,
    ) -> list[wire.Message]:
        """Begin a wave; return the messages that start it.

        A state wave is announced to every cell. A wave of a few literals goes to their
        cells only, as long as the wirings in force were fenced by a wave announced to
        all; its time then does not depend on how many cells there are.

        Raises:
            InvalidValueError: A signal is empty, or names a literal twice: a wave of it
                would not settle.
        """
        if kind == "signal" and not 0 < len(set(signal)) == len(signal):
            rule = "must be one or more literals, each once"
            raise InvalidValueError("signal", rule, signal)
        seeds = self._sensors if kind == "state" else len(signal)
        number = self._next
        self._next += 1
        wave = Wave(number, tick, kind, seeds, signal, repeats)
        self._flying[number] = wave
        self._tries[number] = self._tries.pop(repeats, 0) + 1
        below = min(self._flying)
        cells = sorted({literal >> 1 for literal in signal})
        # Cells learn from announcements alone which waves they may forget.
        late = number - self._fence > _UNANNOUNCED
        if kind == "state" or self._stale or late or 2 * len(cells) > self._sensors:
            self._fence, self._stale = number, False
            return [wave.start(below, number)]
        return [wave.start(below, self._fence, cell) for cell in cells]

    def report(self, settled: wire.Settled) -> Wave | None:
        """Take in a report; return its wave if that has settled now.

        A report on a wave that was given up is dropped.

        Raises:
            MessageError: The report cannot be right.
        """
        wave = self._flying.get(settled.wave)
        if wave is None:
            return None
        wave.report(settled)
        if not wave.is_settled:
            return None
        del self._flying[wave.number]
        del self._tries[wave.number]
        return wave

    def repeat(self, number: int, signal: tuple[int, ...]) -> list[wire.Message]:
        """Give up wave `number` and send it again under a new number.

        Args:
            number: A wave in flight.
            signal: For a state wave, the literals observed: a cell that missed the
                observation still fires then.

        Raises:
            WaveLostError: It was sent often enough; the error names the credit that is
                missing and the cells that are silent.
        """
        wave = self._flying[number]
        signal = wave.signal or signal
        if self._tries[number] > self._repeats:
            raise WaveLostError(self._loss(wave, signal))
        del self._flying[number]
        whole = self.rewire_whole()
        return [*whole, *self.start(wave.kind, wave.tick, signal, number)]

    def _loss(self, wave: Wave, signal: tuple[int, ...]) -> str:
        def targets(literal: int) -> list[int]:
            return [int(b) for b in np.flatnonzero(self._edges[literal])]

        silent = wave.silent(signal, targets)
        named = ", ".join(f"cell/{cell}" for cell in silent[:10]) or "none"
        more = f" and {len(silent) - 10} more" if len(silent) > 10 else ""
        return (
            f"wave {wave.number} (tick {wave.tick}): must settle within its deadline,"
            f" got {self._tries[wave.number]} tries; missing credit"
            f" {float(wave.missing):.6g}, silent cells: {named}{more}"
        )
