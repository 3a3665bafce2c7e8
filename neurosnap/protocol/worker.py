"""A worker: many cells in one process, advanced together.

`Worker` is a pure transition, and what it says of a wave is what its cells would say:
the invariants are those of `neurosnap.protocol.cell`, with a few differences in how.

- Pulses between its own cells go from array to array. Those to another worker's leave
  in one message a batch, and all its cells report in one.
- Every wave is announced to every worker, so nothing of a wave is done before its
  announcement, nor, in a state wave, before the reading of its tick.
- Of the pulses in a batch, the one with the fewest hops makes a literal fire.
- Wirings come in frames. One that was lost keeps all its cells silent until they are
  wired anew.
"""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import Host, check_number
from neurosnap.protocol.cell_histories import PartHistory
from neurosnap.protocol.worker_edges import WorkerEdges
from neurosnap.protocol.worker_kernels import Ints, Pulses, carried, outgoing, spread
from neurosnap.protocol.worker_learning import WorkerLearning

_HELD = 1 << 24  # pulses that may wait for what their waves take


class _WorkerWave(msgspec.Struct):
    """What a worker knows of one wave."""

    number: int
    start: wire.WaveStart | None = None  # until its signal has fired
    reached: Ints | None = None  # hops of what fired; None until it is open
    seen: set[tuple[int, int]] = set()  # (worker, part) of batches that came
    waiting: list[Pulses] = []
    held: int = 0  # pulses that came and wait
    part: int = 0  # of the next report
    parts: dict[int, int] = {}  # of the next batch to each worker


class Worker(Host[_WorkerWave, Ints]):
    """The pure core of one worker.

    Args:
        worker: Its number.
        hosted: The cells of every worker, ascending, without a gap.
        learning: What it learns, where workers share the learning; else None.
    """

    def __init__(
        self,
        worker: int,
        hosted: Sequence[range],
        learning: WorkerLearning | None = None,
    ) -> None:
        self._cells = cells = hosted[worker]
        literals, size = range(2 * cells.start, 2 * cells.stop), hosted[-1].stop
        # Its readings are the literals that were on, of cells whose reading is known.
        super().__init__(f"worker/{worker}", literals, (size + 7) // 8)
        self.worker = worker
        self._hosted = hosted
        self._edges = WorkerEdges(hosted, worker)
        self._learning = learning
        self._history = PartHistory(self._who, cells)
        self._held = 0  # pulses that came and wait, in all waves

    def _receive(self, message: wire.Message) -> None:
        match message:
            case wire.PulseBatch():
                self._hold(message)
            case wire.WaveStart():
                self._start(message)
            case wire.Observation():
                self._observe(message)
            case wire.WorkerWiring():
                self._rewire(message)
            case wire.Recall():
                self._out += self._history.answer(message)
            case wire.Reminder():
                self._history.remember(message)
            case wire.Learn() if self._learning is not None:
                if message.bits:
                    self._observe(message)
                self._out += self._learning.learn(message)
            case wire.Band() if self._learning is not None:
                self._learning.receive_band(message)
            case _:
                raise MessageError(f"{wire.topic(message.key)}: is not for a worker")

    # Waves -------------------------------------------------------------------------

    def _hold(self, batch: wire.PulseBatch) -> None:
        """Keep what another worker sent, once."""
        pulses = self._edges.pulses(batch)
        if not self._counts("pulsebatch", batch.wave, 0):
            return
        if self._held + len(pulses.hops) > _HELD:
            raise MessageError(f"pulsebatch: must leave up to {_HELD} pulses waiting")
        wave = self._wave(batch.wave)
        way = (batch.worker, batch.part)
        if way not in wave.seen:
            wave.seen.add(way)
            wave.waiting.append(pulses)
            wave.held += len(pulses.hops)
            self._held += len(pulses.hops)
            self._remembered += 1

    def _wave(self, number: int) -> _WorkerWave:
        """Return what is known of a wave, which may be nothing yet."""
        return self._waves.setdefault(number, _WorkerWave(number))

    def _start(self, start: wire.WaveStart) -> None:
        if start.cell >= 0:
            raise MessageError(
                f"wavestart: must be for all, got one for cell {start.cell}"
            )
        counts = self._follow(start)
        self._held = sum(wave.held for wave in self._waves.values())
        if counts:
            wave = self._wave(start.wave)
            if wave.reached is None:
                wave.start = wave.start or self._narrowed(start)

    def _finish(self) -> None:
        """Pass on all that can be; what cannot be yet waits with its wave."""
        if not self._wired:
            return
        for wave in self._waves.values():
            if wave.start is not None:
                self._open(wave, wave.start)
            if wave.reached is not None and wave.waiting:
                self._spread(wave, wave.reached)

    def _open(self, wave: _WorkerWave, start: wire.WaveStart) -> None:
        """Let the wave's signal fire, if all is there that it takes."""
        if start.kind == "signal":
            asked = np.array(start.signal, np.int32)
        elif start.tick in self._readings:
            asked = self._readings[start.tick]
        else:
            return
        wave.start = None
        wave.reached = np.full(2 * len(self._cells), -1, np.int32)
        self._readings.join(start.tick)
        if len(asked):
            credit = np.full_like(asked, start.credit)
            wave.waiting.append(Pulses(asked, asked, np.zeros_like(asked), credit))

    def _spread(self, wave: _WorkerWave, reached: Ints) -> None:
        """Pass on what waits in a wave, and report."""
        net = self._edges.net
        _, targets, hops, credit = map(np.concatenate, zip(*wave.waiting, strict=True))
        self._held -= wave.held
        wave.waiting, wave.held = [], 0
        order = np.argsort(hops, kind="stable")
        fired = spread(net, reached, targets[order], hops[order], credit[order])
        # Where nothing is compiled, its numbers are ones of numpy.
        for to in range(len(self._hosted)):
            if to == self.worker:
                continue
            leaving = outgoing(net, reached, fired, to)
            if len(leaving.targets):
                part = wave.parts.get(to, 0)
                wave.parts[to] = part + 1
                fields = (field.tobytes() for field in leaving)
                batch = wire.PulseBatch(wave.number, self.worker, to, part, *fields)
                self._out.append(batch)
        self._out.append(
            wire.WorkerReport(
                wave=wave.number,
                worker=self.worker,
                part=wave.part,
                literals=fired.literals.tobytes(),
                hops=reached[fired.literals - net.first].tobytes(),
                credit=carried(fired.back, int(fired.least)),
                pulses=int(fired.pulses),
                epoch=self._epoch,
            )
        )
        wave.part += 1

    # What the coordinator and the world say ------------------------------------------

    def _observe(self, observation: wire.Observation | wire.Learn) -> None:
        if not self._is_new(observation):
            return
        cells = np.arange(self._cells.start, self._cells.stop, dtype=np.int32)
        bits = _unpacked(observation.bits)
        if observation.known:
            cells = cells[_unpacked(observation.known)[cells] > 0]
        read = 2 * cells + (1 - bits[cells])
        self._readings.keep(observation.tick, read)
        self._history.observe(observation.tick, read)

    def _rewire(self, wiring: wire.WorkerWiring) -> None:
        # One far ahead would make the true ones all come too late.
        check_number("workerwiring: epoch", wiring.epoch, self._epoch)
        self._edges.check(wiring)
        if self._changes(wiring):
            self._edges.change(wiring)


def _unpacked(data: bytes) -> NDArray[np.uint8]:
    """Return packed bits, and those that fill the last byte."""
    return np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
