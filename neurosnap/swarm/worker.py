"""A worker: many cells in one process, which it advances together.

`Worker` is a pure transition, and what it says of a wave is what its cells would say:
the invariants are those of `neurosnap.swarm.cell`, with a few differences in how.

- Pulses between its own cells go from array to array. Those to another worker's leave
  in one message a burst, and all its cells report in one.
- Every wave is announced to every worker, so nothing of a wave is done before its
  announcement, nor, in a state wave, before the reading of its tick.
- Of the pulses in a burst, the one with the fewest hops makes a literal fire.
- Wirings come in frames. One that was lost keeps all its cells silent until they are
  wired anew.
"""

import asyncio
from collections.abc import Collection, Iterable, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.fabric.protocol import Fabric
from neurosnap.swarm.mesh import Mesh
from neurosnap.swarm.part import decoded, take_part, wrong_readings
from neurosnap.swarm.process import Reporter, Seat
from neurosnap.swarm.shares import shares
from neurosnap.swarm.spread import Ints, Pulses, carried, outgoing, spread, warm
from neurosnap.swarm.wave import DEEPEST

_READINGS = 8  # ticks a worker remembers; a wave is never further behind, or ahead
_AHEAD = 1 << 12  # waves in flight reach no further than that beyond the last announced
_WAVES = 2 * _AHEAD  # a worker knows of at once
_HELD = 1 << 24  # pulses that may wait for what their waves take
_BURSTS = 1 << 17  # a worker remembers of all these together


class _Wave:
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
        self.seen: set[tuple[int, int]] = set()  # (worker, part) of bursts that came
        self.waiting: list[Pulses] = []
        self.held = 0  # pulses that came and wait
        self.part = 0  # of the next report
        self.parts: dict[int, int] = {}  # of the next burst to each worker


class Worker:
    """The sans-I/O core of one worker.

    Args:
        worker: Its number.
        hosted: The cells of every worker, ascending, without a gap.
    """

    def __init__(self, worker: int, hosted: Sequence[range]) -> None:
        self.worker = worker
        self._who = f"worker/{worker}"
        self._hosted = hosted
        self._cells = hosted[worker]
        self._mesh = Mesh(hosted, worker)
        self._epoch = 0
        self._wired = True
        # tick -> the literals that were on, of the cells whose reading is known
        self._readings: dict[int, Ints] = {}
        self._tick = 0  # the last it took part in
        self._waves: dict[int, _Wave] = {}
        self._settled_below = 1
        self._announced = 0  # the last wave that was

    def receive(self, burst: Iterable[wire.Message]) -> list[wire.Message]:
        """Take in `burst` and return what the worker sends for it, in order.

        All that came of a wave is worked on at once. Its pulses come before its report,
        because others are waiting for them. Cost: proportional to the burst, to the
        cells for each wave in it, and to the out-edges of what fires.
        """
        out: list[wire.Message] = []
        for message in burst:
            try:
                self._take(message, out)
            except MessageError as error:
                out.append(wire.Fault(self._who, str(error)))
        self._advance(out)
        return out

    def _take(self, message: wire.Message, out: list[wire.Message]) -> None:
        """Take in one message; refuse one that cannot be right."""
        match message:
            case wire.Burst():
                self._hold(message)
            case wire.WaveStart():
                self._check_start(message)
                self._start(message)
            case wire.Observation():
                self._check_observation(message)
                self._latch(message)
            case wire.Loom():
                self._check_epoch(message)
                self._mesh.check(message)
                # What came before it was meant for the wiring before it.
                self._advance(out)
                self._rewire(message)
            case _:
                raise MessageError(f"{message.key}: is not for a worker")

    # Waves -------------------------------------------------------------------------

    def _hold(self, burst: wire.Burst) -> None:
        """Keep what another worker sent, once."""
        pulses = self._mesh.pulses(burst)
        self._check_wave("burst", burst.wave)
        if burst.wave < self._settled_below:
            return
        held = sum(wave.held for wave in self._waves.values())
        if held + len(pulses.hops) > _HELD:
            raise MessageError(f"burst: must leave up to {_HELD} pulses waiting")
        if sum(len(wave.seen) for wave in self._waves.values()) >= _BURSTS:
            rule = f"must be one of {_BURSTS} in flight"
            raise MessageError(f"burst: {rule}, got one more")
        self._check_room("burst", burst.wave, self._waves)
        wave = self._wave(burst.wave)
        way = (burst.worker, burst.part)
        if way not in wave.seen:
            wave.seen.add(way)
            wave.waiting.append(pulses)
            wave.held += len(pulses.hops)

    def _wave(self, number: int) -> _Wave:
        """Return what is known of a wave, which may be nothing yet."""
        wave = self._waves.get(number)
        if wave is None:
            wave = self._waves[number] = _Wave(number)
        return wave

    def _check_wave(self, name: str, number: int) -> None:
        """Refuse a wave too far ahead to have come about.

        Before the first there is no telling: a run that is resumed goes on with the
        numbers it had.
        """
        if 0 < self._announced < number - _AHEAD:
            rule = f"must be at most {_AHEAD} beyond {self._announced}"
            raise MessageError(f"{name}: wave {rule}, got {number}")

    def _check_room(self, name: str, number: int, waves: Collection[int]) -> None:
        """Refuse a wave that would be one too many."""
        if number not in waves and len(waves) >= _WAVES:
            rule = f"must be of {_WAVES} waves in all"
            raise MessageError(f"{name}: {rule}, got wave {number} too")

    def _check_start(self, start: wire.WaveStart) -> None:
        if start.cell >= 0:
            raise MessageError(f"wave: must be for all, got one for cell {start.cell}")
        if start.credit > DEEPEST:
            got = f"got {start.credit}"
            raise MessageError(f"wave: must have credit up to {DEEPEST}, {got}")
        # Waves that begin after this one cannot have settled before it.
        if start.settled_below > start.wave + 1:
            rule = f"must settle nothing after wave {start.wave}"
            raise MessageError(f"wave: {rule}, got all below {start.settled_below}")
        self._check_wave("wave", start.wave)
        self._check_tick("wave", start.tick)
        # What it settles makes room for it.
        self._check_room("wave", start.wave, self._left(start))

    def _left(self, start: wire.WaveStart) -> dict[int, _Wave]:
        """Return the waves known that may still come about after `start`."""
        below = max(self._settled_below, start.settled_below)
        beyond = max(self._announced, start.wave) + _AHEAD
        return {n: w for n, w in self._waves.items() if below <= n <= beyond}

    def _start(self, start: wire.WaveStart) -> None:
        self._waves = self._left(start)
        self._announced = max(self._announced, start.wave)
        self._settled_below = max(self._settled_below, start.settled_below)
        if start.wave >= self._settled_below:
            wave = self._wave(start.wave)
            if wave.reached is None:
                wave.start = wave.start or self._narrowed(start)

    def _narrowed(self, start: wire.WaveStart) -> wire.WaveStart:
        """Return `start` with no more of its signal than is kept: its own, once."""
        if not start.signal:
            return start
        signal = np.array(start.signal, np.int32)
        cells = signal >> 1
        own = signal[(cells >= self._cells.start) & (cells < self._cells.stop)]
        kept = tuple(dict.fromkeys(own.tolist()))
        return msgspec.structs.replace(start, kind="signal", signal=kept)

    def _advance(self, out: list[wire.Message]) -> None:
        """Pass on all that can be; what cannot be yet waits with its wave."""
        if not self._wired:
            return
        for wave in self._waves.values():
            if wave.start is not None:
                self._open(wave, wave.start)
            if wave.reached is not None and wave.waiting:
                self._spread(wave, wave.reached, out)

    def _open(self, wave: _Wave, start: wire.WaveStart) -> None:
        """Let the wave's signal fire, if all is there that it takes."""
        if start.kind == "signal":
            asked = np.array(start.signal, np.int32)
        elif start.tick in self._readings:
            asked = self._readings[start.tick]
        else:
            return
        wave.start = None
        wave.reached = np.full(2 * len(self._cells), -1, np.int32)
        self._join(start.tick)
        if len(asked):
            credit = np.full_like(asked, start.credit)
            wave.waiting.append(Pulses(asked, asked, np.zeros_like(asked), credit))

    def _spread(self, wave: _Wave, reached: Ints, out: list[wire.Message]) -> None:
        """Pass on what waits in a wave, and report."""
        net = self._mesh.net
        _, targets, hops, credit = map(np.concatenate, zip(*wave.waiting, strict=True))
        wave.waiting, wave.held = [], 0
        order = np.argsort(hops, kind="stable")
        fired = spread(net, reached, targets[order], hops[order], credit[order])
        for to in range(len(self._hosted)):
            leaving = outgoing(net, reached, fired, to)
            if to != self.worker and len(leaving.targets):
                part = wave.parts.get(to, 0)
                wave.parts[to] = part + 1
                fields = (field.tobytes() for field in leaving)
                out.append(wire.Burst(wave.number, self.worker, to, part, *fields))
        out.append(
            wire.Tally(
                wave=wave.number,
                worker=self.worker,
                part=wave.part,
                literals=fired.literals.tobytes(),
                hops=reached[fired.literals - net.first].tobytes(),
                credit=carried(fired.back, fired.least),
                pulses=fired.pulses,
                epoch=self._epoch,
            )
        )
        wave.part += 1

    # What the coordinator and the world say ------------------------------------------

    def _check_observation(self, observation: wire.Observation) -> None:
        size = (self._hosted[-1].stop + 7) // 8
        if len(observation.bits) != size:
            got = f"got {len(observation.bits)}"
            raise MessageError(f"observe: must hold {size} bytes, {got}")
        if (wrong := wrong_readings(observation)) is not None:
            raise MessageError(wrong)
        self._check_tick("observe", observation.tick)

    def _check_tick(self, name: str, tick: int) -> None:
        if self._tick and tick > self._tick + _READINGS:
            rule = f"must be at most {_READINGS} ticks after {self._tick}"
            raise MessageError(f"{name}: {rule}, got {tick}")

    def _latch(self, observation: wire.Observation) -> None:
        if observation.tick in self._readings:
            return
        cells = np.arange(self._cells.start, self._cells.stop, dtype=np.int32)
        if observation.known:
            cells = cells[_unpacked(observation.known)[cells] > 0]
        bits = _unpacked(observation.bits)
        self._readings[observation.tick] = 2 * cells + (1 - bits[cells])
        if len(self._readings) > _READINGS:
            del self._readings[min(self._readings)]

    def _join(self, tick: int) -> None:
        """Take note of the tick, and forget readings that were too far ahead of it."""
        if tick > self._tick:
            self._tick = tick
            self._readings = {
                read: literals
                for read, literals in self._readings.items()
                if read <= tick + _READINGS
            }

    def _check_epoch(self, loom: wire.Loom) -> None:
        """Refuse a frame so far ahead that the true ones would all come too late."""
        if 0 < self._epoch < loom.epoch - _AHEAD:
            rule = f"must be at most {_AHEAD} beyond {self._epoch}"
            raise MessageError(f"loom: epoch {rule}, got {loom.epoch}")

    def _rewire(self, loom: wire.Loom) -> None:
        if loom.epoch <= self._epoch:
            return
        if loom.after not in (0, self._epoch):
            # A change was lost. Taking part with the wrong edges would give a wrong
            # state; staying silent makes the wave's deadline name this worker.
            self._wired = False
            missed = f"must build on epoch {self._epoch}, got {loom.after}"
            raise MessageError(f"loom: {missed}")
        self._mesh.change(loom)
        self._epoch = loom.epoch
        self._wired = True


def _unpacked(data: bytes) -> NDArray[np.uint8]:
    """Return packed bits, and those that fill the last byte."""
    return np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")


async def run_worker(
    worker: int, hosted: Sequence[range], fabric: Fabric, stop: asyncio.Event
) -> None:
    """Be a worker until `stop` is set.

    Reads `wire.worker_keys`; publishes bursts, tallies and faults.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Worker(worker, hosted)
    warm()

    def handle(deliveries: list[wire.Delivery]) -> None:
        fabric.publish(*core.receive(decoded(fabric, deliveries)))

    await fabric.subscribe(wire.worker_keys(worker), handle)
    await fabric.announce()
    await fabric.serve(stop)


async def be_worker(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    worker: int,
    cells: int,
    workers: int,
) -> None:
    """Be one worker of so many, for so many cells."""
    async with seat.fabric(swift=True) as fabric:
        hosted = shares(cells, workers)
        await take_part(fabric, run_worker(worker, hosted, fabric, stop))
