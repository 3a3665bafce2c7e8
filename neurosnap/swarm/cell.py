"""A cell: one sensor, computing with its neighbours by pulses.

`Cell` is a pure transition: a burst of messages in, messages out, no clock, no network.
Its invariants:

- A literal fires at most once a wave, on the first pulse for it or because it belongs
  to the wave's signal; firing sends one pulse along every out-edge of the literal.
- Whatever credit comes in goes out again in the same burst, in pulses and in a report.
- Nothing of a wave is done before its fence has been seen: the last wave announced to
  every cell, itself or one before (and, in a state wave, before the reading of its
  tick). The coordinator sends wirings before the fence, so what fires is always the
  wiring the wave was meant for.
- A message that came before changes nothing when it comes again.

A process imports this file a thousand times over: neither numpy nor numba is needed.
"""

import asyncio
from collections.abc import Iterable

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.swarm.part import decoded

_READINGS = 8  # ticks a cell remembers; a wave is never further behind


class _Wave:
    """What a cell knows of one wave."""

    __slots__ = (
        "asked",
        "credit",
        "fence",
        "fired",
        "held",
        "hops",
        "literals",
        "number",
        "part",
        "pulses",
        "seen",
        "start",
    )

    def __init__(self, number: int, fence: int) -> None:
        self.number = number
        self.fence = fence
        self.start: wire.WaveStart | None = None
        self.held: list[wire.Pulse] = []
        self.seen: set[tuple[int, int]] = set()  # (source, target) of pulses that came
        self.asked = False  # the signal's own literals have fired
        self.fired: set[int] = set()
        self.part = 0
        # The next report, gathered over a burst.
        self.literals: list[int] = []
        self.hops: list[int] = []
        self.credit: list[int] = []
        self.pulses = 0


class Cell:
    """The sans-I/O core of one cell.

    Args:
        cell: Its sensor's number; its literals are ``2 * cell`` and ``2 * cell + 1``.
    """

    def __init__(self, cell: int) -> None:
        self.cell = cell
        self._who = f"cell/{cell}"
        self._epoch = 0
        self._wired = True
        self._targets: dict[int, list[int]] = {2 * cell: [], 2 * cell + 1: []}
        self._readings: dict[int, int] = {}  # tick -> the literal that was on
        self._waves: dict[int, _Wave] = {}
        self._settled_below = 1
        self._fence = 0  # the last wave announced to all that has come

    def receive(self, burst: Iterable[wire.Message]) -> list[wire.Message]:
        """Take in `burst` and return what the cell sends for it, in order.

        Pulses come before the report of their wave, because neighbours are waiting for
        them. Cost: proportional to the burst and to the out-edges of what fires.
        """
        out: list[wire.Message] = []
        touched: dict[int, _Wave] = {}  # waves that owe a report
        for message in burst:
            match message:
                case wire.Pulse():
                    self._pulse(message, touched, out)
                case wire.WaveStart():
                    self._start(message, touched, out)
                case wire.Observation():
                    self._latch(message, touched, out)
                case wire.Wiring():
                    self._rewire(message, out)
                case _:
                    out.append(self._fault(f"{message.key}: is not for a cell"))
        out.extend(self._report(wave) for wave in touched.values())
        return out

    def _fault(self, what: str) -> wire.Fault:
        return wire.Fault(self._who, what)

    # Waves -------------------------------------------------------------------------

    def _pulse(
        self,
        pulse: wire.Pulse,
        touched: dict[int, _Wave],
        out: list[wire.Message],
    ) -> None:
        if pulse.target not in self._targets:
            out.append(self._fault(f"pulse: must be for this cell, got {pulse.target}"))
            return
        if pulse.wave < self._settled_below:
            return
        wave = self._wave(pulse.wave, pulse.fence)
        way = (pulse.source, pulse.target)
        if way in wave.seen:
            return
        wave.seen.add(way)
        if self._is_open(wave):
            self._reach(pulse.target, pulse.hops, pulse.credit, wave, out)
            touched[wave.number] = wave
        else:
            wave.held.append(pulse)

    def _wave(self, number: int, fence: int) -> _Wave:
        """Return what is known of a wave, which may be nothing yet."""
        wave = self._waves.get(number)
        if wave is None:
            wave = self._waves[number] = _Wave(number, fence)
        return wave

    def _start(
        self,
        start: wire.WaveStart,
        touched: dict[int, _Wave],
        out: list[wire.Message],
    ) -> None:
        if start.settled_below > self._settled_below:
            self._settled_below = start.settled_below
            self._waves = {
                number: wave
                for number, wave in self._waves.items()
                if number >= start.settled_below
            }
        if start.wave >= self._settled_below:
            wave = self._wave(start.wave, start.fence)
            wave.start = wave.start or start
            self._open(wave, touched, out)
        if start.cell < 0 and start.wave > self._fence:
            self._fence = start.wave
            for wave in self._waves.values():
                self._open(wave, touched, out)

    def _is_open(self, wave: _Wave) -> bool:
        """Tell whether the cell may act: it has the fence, and the reading it needs."""
        start = wave.start
        return (
            self._wired
            and wave.fence <= self._fence
            and (
                start is None
                or start.kind == "signal"
                or bool(start.signal)
                or start.tick in self._readings
            )
        )

    def _open(
        self, wave: _Wave, touched: dict[int, _Wave], out: list[wire.Message]
    ) -> None:
        """Fire what the signal asks of this cell, then the pulses that came early.

        Does nothing when called again: a signal is asked for once, what was held is
        gone.
        """
        if not self._is_open(wave):
            return
        start = wave.start
        if start is not None and not wave.asked:
            wave.asked = True
            for literal in self._asked(start):
                self._reach(literal, 0, start.credit, wave, out)
                touched[wave.number] = wave
        held, wave.held = wave.held, []
        for pulse in held:
            self._reach(pulse.target, pulse.hops, pulse.credit, wave, out)
            touched[wave.number] = wave

    def _asked(self, start: wire.WaveStart) -> list[int]:
        """Return the literals of this cell that a wave's signal holds."""
        if start.kind == "signal" or start.signal:
            return [literal for literal in self._targets if literal in start.signal]
        return [self._readings[start.tick]]

    def _reach(
        self, literal: int, hops: int, credit: int, wave: _Wave, out: list[wire.Message]
    ) -> None:
        """Fire `literal`, or give the credit back if it has fired in this wave."""
        if literal in wave.fired:
            wave.credit.append(credit)
            return
        targets = self._targets[literal]
        shares = wire.split_evenly(credit, len(targets) + 1)
        out.extend(
            wire.Pulse(wave.number, literal, target, hops + 1, share, wave.fence)
            for target, share in zip(targets, shares[1:], strict=True)
        )
        wave.fired.add(literal)
        wave.literals.append(literal)
        wave.hops.append(hops)
        wave.credit.append(shares[0])
        wave.pulses += len(targets)

    def _report(self, wave: _Wave) -> wire.Settled:
        report = wire.Settled(
            wave=wave.number,
            cell=self.cell,
            part=wave.part,
            literals=tuple(wave.literals),
            hops=tuple(wave.hops),
            credit=tuple(wave.credit),
            pulses=wave.pulses,
        )
        wave.part += 1
        wave.literals, wave.hops, wave.credit, wave.pulses = [], [], [], 0
        return report

    # What the coordinator and the world say ------------------------------------------

    def _latch(
        self,
        observation: wire.Observation,
        touched: dict[int, _Wave],
        out: list[wire.Message],
    ) -> None:
        byte, bit = divmod(self.cell, 8)
        if byte >= len(observation.bits):
            what = f"observe: must hold sensor {self.cell}, got {len(observation.bits)}"
            out.append(self._fault(f"{what} bytes"))
            return
        if observation.tick in self._readings:
            return
        on = observation.bits[byte] >> bit & 1
        self._readings[observation.tick] = 2 * self.cell + (1 - on)
        if len(self._readings) > _READINGS:
            del self._readings[min(self._readings)]
        for wave in list(self._waves.values()):
            if wave.start is not None and wave.start.tick == observation.tick:
                self._open(wave, touched, out)

    def _rewire(self, wiring: wire.Wiring, out: list[wire.Message]) -> None:
        if wiring.cell != self.cell:
            out.append(self._fault(f"wiring: must be for this cell, got {wiring.cell}"))
            return
        if wiring.epoch <= self._epoch:
            return
        if wiring.after not in (0, self._epoch):
            # A change was lost. Taking part with the wrong edges would give a wrong
            # state; staying silent makes the wave's deadline name this cell.
            self._wired = False
            missed = f"must build on epoch {self._epoch}, got {wiring.after}"
            out.append(self._fault(f"wiring: {missed}"))
            return
        own, complement = 2 * self.cell, 2 * self.cell + 1
        for literal, add, drop in (
            (own, wiring.add, wiring.drop),
            (complement, wiring.add_complement, wiring.drop_complement),
        ):
            kept = set() if wiring.after == 0 else set(self._targets[literal])
            self._targets[literal] = sorted((kept - set(drop)) | set(add))
        self._epoch = wiring.epoch
        self._wired = True


async def run_cell(cell: int, fabric: Fabric, stop: asyncio.Event) -> None:
    """Be the cell of sensor `cell` until `stop` is set.

    Reads `wire.cell_keys`; publishes pulses, reports and faults.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Cell(cell)

    def handle(deliveries: list[wire.Delivery]) -> None:
        fabric.publish(*core.receive(decoded(fabric, deliveries)))

    await fabric.subscribe(wire.cell_keys(cell), handle)
    await fabric.announce()
    await fabric.serve(stop)
