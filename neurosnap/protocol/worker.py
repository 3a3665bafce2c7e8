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

from collections.abc import Iterable, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.message_checks import (
    AHEAD,
    RecentReadings,
    check_number,
    check_readings,
    check_room,
    check_start,
)
from neurosnap.protocol.part_history import WorkerHistory
from neurosnap.protocol.worker_edges import WorkerEdges
from neurosnap.protocol.worker_kernels import (
    Ints,
    Pulses,
    carried,
    outgoing,
    spread,
)
from neurosnap.protocol.worker_learning import WorkerLearning

_HELD = 1 << 24  # pulses that may wait for what their waves take
_BATCHES = 1 << 17  # a worker remembers of all waves together


class _WorkerWave:
    """What a worker knows of one wave."""

    __slots__ = (
        "held",
        "number",
        "part",
        "parts",
        "reached",
        "seen",
        "start",
        "waiting",
    )

    def __init__(self, number: int) -> None:
        self.number = number
        self.start: wire.WaveStart | None = None  # until its signal has fired
        self.reached: Ints | None = None  # hops of what fired; None until it is open
        self.seen: set[tuple[int, int]] = set()  # (worker, part) of batches that came
        self.waiting: list[Pulses] = []
        self.held = 0  # pulses that came and wait
        self.part = 0  # of the next report
        self.parts: dict[int, int] = {}  # of the next batch to each worker


class Worker:
    """The sans-I/O core of one worker.

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
        self.worker = worker
        self._who = f"worker/{worker}"
        self._hosted = hosted
        self._cells = hosted[worker]
        self._edges = WorkerEdges(hosted, worker)
        self._learning = learning
        self._epoch = 0
        self._wired = True
        # The literals that were on, of the cells whose reading is known.
        self._readings = RecentReadings[Ints]()
        self._history = WorkerHistory(worker, self._cells)
        self._waves: dict[int, _WorkerWave] = {}
        self._settled_below = 1
        self._announced = 0  # the last wave that was
        self._held = 0  # pulses that came and wait, in all waves
        self._remembered = 0  # batches, in all waves
        self._out: list[wire.Message] = []  # of the batch that is worked on

    def receive(self, batch: Iterable[wire.Message]) -> list[wire.Message]:
        """Receive `batch` and return what the worker sends for it, in order.

        All that came of a wave is worked on at once. Its pulses come before its report,
        because others are waiting for them. Cost: proportional to the batch, to the
        cells for each wave in it, and to the out-edges of what fires.
        """
        for message in batch:
            try:
                self._receive(message)
            except MessageError as error:
                self._out.append(wire.Fault(self._who, str(error)))
        self._advance()
        out, self._out = self._out, []
        return out

    def _receive(self, message: wire.Message) -> None:
        """Act on a message that can be right.

        Raises:
            MessageError: It cannot; nothing has changed.
        """
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
            case _ if self._learning is None:
                raise MessageError(f"{wire.topic(message.key)}: is not for a worker")
            case wire.Learn():
                if message.bits:  # the observation itself may have been lost
                    self._observe(message)
                self._out += self._learning.learn(message)
            case wire.Band():
                self._learning.receive_band(message)
            case _:
                raise MessageError(f"{wire.topic(message.key)}: is not for a worker")

    # Waves -------------------------------------------------------------------------

    def _hold(self, batch: wire.PulseBatch) -> None:
        """Keep what another worker sent, once."""
        pulses = self._edges.pulses(batch)
        check_number("pulsebatch: wave", batch.wave, self._announced)
        if batch.wave < self._settled_below:
            return
        if self._held + len(pulses.hops) > _HELD:
            raise MessageError(f"pulsebatch: must leave up to {_HELD} pulses waiting")
        if self._remembered >= _BATCHES:
            rule = f"must be one of {_BATCHES} in flight"
            raise MessageError(f"pulsebatch: {rule}, got one more")
        check_room("pulsebatch", batch.wave, self._waves)
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
        wave = self._waves.get(number)
        if wave is None:
            wave = self._waves[number] = _WorkerWave(number)
        return wave

    def _start(self, start: wire.WaveStart) -> None:
        if start.cell >= 0:
            raise MessageError(
                f"wavestart: must be for all, got one for cell {start.cell}"
            )
        check_start(start)
        check_number("wavestart: wave", start.wave, self._announced)
        self._readings.check_tick("wavestart", start.tick)
        # What it settles makes room for it.
        left = self._left(start)
        check_room("wavestart", start.wave, left)
        self._waves = left
        self._held = sum(wave.held for wave in self._waves.values())
        self._remembered = sum(len(wave.seen) for wave in self._waves.values())
        self._announced = max(self._announced, start.wave)
        self._settled_below = max(self._settled_below, start.settled_below)
        if start.wave >= self._settled_below:
            wave = self._wave(start.wave)
            if wave.reached is None:
                wave.start = wave.start or self._narrowed(start)

    def _left(self, start: wire.WaveStart) -> dict[int, _WorkerWave]:
        """Return the waves known that may still come about after `start`."""
        below = max(self._settled_below, start.settled_below)
        beyond = max(self._announced, start.wave) + AHEAD
        return {n: w for n, w in self._waves.items() if below <= n <= beyond}

    def _narrowed(self, start: wire.WaveStart) -> wire.WaveStart:
        """Return `start` with no more of its signal than is kept: its own, once."""
        if not start.signal:
            return start
        signal = np.array(start.signal, np.int32)
        cells = signal >> 1
        own = signal[(cells >= self._cells.start) & (cells < self._cells.stop)]
        kept = tuple(dict.fromkeys(own.tolist()))
        return msgspec.structs.replace(start, kind="signal", signal=kept)

    def _advance(self) -> None:
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
        size = (self._hosted[-1].stop + 7) // 8
        if len(observation.bits) != size:
            got = f"got {len(observation.bits)}"
            raise MessageError(f"observation: must hold {size} bytes, {got}")
        check_readings(observation)
        self._readings.check_tick("observation", observation.tick)
        if observation.tick in self._readings:
            return
        cells = np.arange(self._cells.start, self._cells.stop, dtype=np.int32)
        bits, known = _unpacked(observation.bits), None
        own = bits[cells] > 0
        if observation.known:
            known = _unpacked(observation.known)[cells] > 0
            cells = cells[known]
        self._readings.keep(observation.tick, 2 * cells + (1 - bits[cells]))
        self._history.observe(observation.tick, own, known)

    def _rewire(self, wiring: wire.WorkerWiring) -> None:
        # One far ahead would make the true ones all come too late.
        check_number("workerwiring: epoch", wiring.epoch, self._epoch)
        self._edges.check(wiring)
        self._advance()  # what came before it was meant for the wiring before it
        if wiring.epoch <= self._epoch:
            return
        if wiring.after not in (0, self._epoch):
            # A change was lost. Taking part with the wrong edges would give a wrong
            # state; staying silent makes the wave's deadline name this worker.
            self._wired = False
            missed = f"must build on epoch {self._epoch}, got {wiring.after}"
            raise MessageError(f"workerwiring: {missed}")
        self._edges.change(wiring)
        self._epoch = wiring.epoch
        self._wired = True


def _unpacked(data: bytes) -> NDArray[np.uint8]:
    """Return packed bits, and those that fill the last byte."""
    return np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
