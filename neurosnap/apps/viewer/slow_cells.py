"""Which cells are slow or dead: whom a wave that has not settled waits for.

A part has answered a wave once it has sent its first pulse or report. A cell without
edges of its own to pulse reports once it has the pulses that are sure to come: so it
may wait itself.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker_shares import shares
from neurosnap.recording.read.chunk_messages import ChunkMessages

_TOPICS = "pulse", "pulsebatch", "cellreport", "workerreport"


class Answers:
    """What was heard of waves; a wave's start is to be added first."""

    def __init__(self, options: RunOptions) -> None:
        cells, workers = options.body.count, options.sharing
        self.parts = shares(cells, min(workers or cells, cells))
        """The cells of each part: a worker, or a cell by itself."""
        self._starts: dict[int, tuple[wire.WaveStart, int]] = {}  # by wave
        # By wave: the parts that answered, and those that were sent a pulse.
        self._heard: defaultdict[int, set[int]] = defaultdict(set)
        self._asked: defaultdict[int, set[int]] = defaultdict(set)
        self._left: set[int] = set()

    def take(self, chunk: ChunkMessages, ticks: range) -> None:
        """Take over what a chunk has of the waves of some ticks."""
        for start, _, _, sent, _ in chunk.of_topic("wavestart"):
            if isinstance(start, wire.WaveStart) and start.tick in ticks:
                self._starts.setdefault(start.wave, (start, sent))
        for leave in chunk.all("leave", wire.Leave):
            role, _, number = leave.who.partition("/")
            if role in ("cell", "worker"):
                self._left.add(int(number))
        for topic in _TOPICS:
            for recorded in chunk.of_topic(topic):
                match recorded.message:
                    case wire.Pulse(wave=wave, source=source, target=target):
                        self._heard[wave].add(source >> 1)
                        self._asked[wave].add(target >> 1)
                    case wire.PulseBatch(wave=wave, worker=worker, to=to):
                        self._heard[wave].add(worker)
                        self._asked[wave].add(to)
                    case wire.CellReport(wave=wave, cell=part):
                        self._heard[wave].add(part)
                    case wire.WorkerReport(wave=wave, worker=part):
                        self._heard[wave].add(part)

    def silent(self, start: wire.WaveStart, observed: Iterable[int]) -> list[int]:
        """Return the parts that were asked in a wave, and neither answered nor left.

        Args:
            start: The wave's.
            observed: The literals that start the state wave of its tick.
        """
        fired = {literal >> 1 for literal in start.signal or observed}
        parts = {k for k, own in enumerate(self.parts) if not fired.isdisjoint(own)}
        parts |= {part for part in self._asked[start.wave] if part < len(self.parts)}
        return sorted(parts - self._heard[start.wave] - self._left)

    def began(self, start: wire.WaveStart) -> int:
        """Return when a wave began, or the first that it repeats: ns since 1970."""
        while start.repeats in self._starts:
            start, _ = self._starts[start.repeats]
        return self._starts[start.wave][1]


def not_waiting(
    silent: Sequence[int], fired: Sequence[int], edges: NDArray[np.int64]
) -> list[int]:
    """Return the silent cells of a state wave that do not just wait for one of them.

    Args:
        silent: The cells.
        fired: The literals that started the wave.
        edges: The wiring, as ``source << 32 | target``.
    """
    own = [literal for literal in fired if literal >> 1 in {*silent}]
    edges = edges[np.isin(edges >> 32, own)]
    pulse = {*(edges >> 33).tolist()}
    wait = {*((edges & 0xFFFFFFFF) >> 1).tolist()} - pulse
    return [cell for cell in silent if cell not in wait]
