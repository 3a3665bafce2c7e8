"""A cell: one sensor that computes with its neighbours by pulses.

`Cell` is a pure transition: a batch of messages in, messages out, no clock, no network.
Its invariants:

- A literal fires at most once a wave, on the first pulse for it or because it belongs
  to the wave's signal; firing sends one pulse along every out-edge of the literal.
- Whatever credit comes in goes out again, in pulses at once and in a report that waits
  for the pulses that are sure to come. In a state wave every literal that was read
  fires, and the observation says which these are. So a cell reports once, and not for
  each batch. (Its in-edges are the contrapositives of its out-edges: ``a -> b`` iff
  ``b* -> a*``.) If a pulse is lost, the wave is repeated as a signal, of which a cell
  does not know what is to come: then each batch is reported, and what is silent shows.
- Nothing of a wave is done before its fence has been seen: the last wave announced to
  every cell, itself or one before (and, in a state wave, before the reading of its
  tick). The coordinator sends wirings before the fence, so what fires is always the
  wiring the wave was meant for; its report says which that was, so that one that got
  lost is noticed.
- A message that came before changes nothing when it comes again.
- A message that cannot be right is answered with a fault and changes nothing; the
  memory used by messages that may be right is bounded. A forged message that the
  coordinator, the world or a neighbour could have sent cannot be detected here.

A thousand cell processes import this file: it needs neither numpy nor numba.
"""

import msgspec

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import (
    DEEPEST,
    Host,
    check_number,
    split_evenly,
)
from neurosnap.protocol.cell_histories import PartHistory

LIGHT = 512
"""Messages that a cell may send from the thread on which it receives. Twice as many, of
half a kilobyte, fit the queue of a session: so that thread, which may be the one that
empties the queue, never waits for room."""


class _Wave(msgspec.Struct):
    """What a cell knows of one wave."""

    number: int
    fence: int
    start: wire.WaveStart | None = None
    held: list[wire.Pulse] = []
    seen: set[tuple[int, int]] = set()  # (source, target) of pulses that came
    asked: bool = False  # the signal's own literals have fired
    due: int = 0  # pulses that are sure to come, and a report waits for
    fired: set[int] = set()
    part: int = 0
    # The next report, gathered over a batch.
    literals: list[int] = []
    hops: list[int] = []
    credit: list[int] = []
    pulses: int = 0


class Cell(Host[_Wave, wire.Observation]):
    """The pure core of one cell; its literals: ``2 * cell`` and ``2 * cell + 1``."""

    def __init__(self, cell: int) -> None:
        super().__init__(f"cell/{cell}", range(2 * cell, 2 * cell + 2))
        self.cell = cell
        self._targets: dict[int, list[int]] = {each: [] for each in self._literals}
        self._history = PartHistory(self._who, range(cell, cell + 1))
        self._touched: dict[int, _Wave] = {}  # waves that owe a report

    @property
    def is_light(self) -> bool:
        """Whether all that it may send next, beside what waits, is at most `LIGHT`."""
        return self.waiting + sum(map(len, self._targets.values())) <= LIGHT

    def _receive(self, message: wire.Message) -> None:
        match message:
            case wire.Pulse():  # first: there are by far the most
                self._receive_pulse(message)
            case wire.WaveStart():
                self._start(message)
            case wire.Observation():
                self._observe(message)
            case wire.Wiring():
                self._rewire(message)
            case wire.Recall(cell=cell) if cell not in (-1, self.cell):
                raise MessageError(f"recall: must be for this cell, got {cell}")
            case wire.Recall():
                self._out += self._history.answer(message)
            case wire.Reminder():
                self._history.remember(message)
            case _:
                raise MessageError(f"{wire.topic(message.key)}: is not for a cell")

    # Waves -------------------------------------------------------------------------

    def _receive_pulse(self, pulse: wire.Pulse) -> None:
        if pulse.target not in self._targets:
            raise MessageError(f"pulse: must be for this cell, got {pulse.target}")
        if (most := max(pulse.hops, pulse.credit)) > DEEPEST:
            rule = f"must have hops, credit up to {DEEPEST}"
            raise MessageError(f"pulse: {rule}, got {most}")
        if not self._counts("pulse", pulse.wave, pulse.fence):
            return
        wave = self._wave(pulse.wave, pulse.fence)
        way = (pulse.source, pulse.target)
        if way in wave.seen:
            return
        wave.seen.add(way)
        self._remembered += 1
        if self._is_open(wave):
            self._reach(pulse.target, pulse.hops, pulse.credit, wave)
        else:
            wave.held.append(pulse)

    def _wave(self, number: int, fence: int) -> _Wave:
        """Return what is known of a wave, which may be nothing yet."""
        wave = self._waves.get(number)
        if wave is None:
            wave = self._waves[number] = _Wave(number, fence)
        return wave

    def _start(self, start: wire.WaveStart) -> None:
        if start.cell not in (-1, self.cell):
            raise MessageError(f"wavestart: must be for this cell, got {start.cell}")
        before = self._fence
        if self._follow(start):
            wave = self._wave(start.wave, start.fence)
            wave.start = wave.start or self._narrowed(start)
            self._open(wave)
        if self._fence > before:
            for wave in self._waves.values():
                self._open(wave)

    def _is_open(self, wave: _Wave) -> bool:
        """Tell whether the cell may act: it has the fence, and the reading it needs."""
        start = wave.start
        return (
            self._wired
            and wave.fence <= self._fence
            and (
                start is None or start.kind == "signal" or start.tick in self._readings
            )
        )

    def _open(self, wave: _Wave) -> None:
        """Fire what the signal asks of this cell, then the pulses that came early.

        May be called again: the signal and each held pulse are processed only once.
        """
        if not self._is_open(wave):
            return
        start = wave.start
        if start is not None and not wave.asked:
            wave.asked = True
            self._readings.join(start.tick)
            asked = start.signal
            if start.kind == "state":
                observation = self._readings[start.tick]
                wave.due, asked = self._due(observation), self._read(observation)
            for literal in asked:
                self._reach(literal, 0, start.credit, wave)
        held, wave.held = wave.held, []
        for pulse in held:
            self._reach(pulse.target, pulse.hops, pulse.credit, wave)

    def _read(self, observation: wire.Observation) -> tuple[int, ...]:
        """Return the literal that the cell read; none where that is unknown."""
        off = not _is_on(observation.bits, self.cell)
        known = not observation.known or _is_on(observation.known, self.cell)
        return (2 * self.cell + off,) if known else ()

    def _due(self, observation: wire.Observation) -> int:
        """Return how many pulses of the state wave of a tick are sure to come."""
        bits, known = observation.bits, observation.known
        count = 0
        for targets in self._targets.values():
            for target in targets:  # the one that pulses this cell is its complement
                sensor = target >> 1
                if _is_on(bits, sensor) == target & 1:
                    count += not known or _is_on(known, sensor)
        return count

    def _reach(self, literal: int, hops: int, credit: int, wave: _Wave) -> None:
        """Fire `literal`, or give the credit back if it has fired in this wave."""
        self._touched[wave.number] = wave
        if literal in wave.fired:
            wave.credit.append(credit)
            return
        targets = self._targets[literal]
        shares = split_evenly(credit, len(targets) + 1)
        self._out.extend(
            wire.Pulse(wave.number, literal, target, hops + 1, share, wave.fence)
            for target, share in zip(targets, shares[1:], strict=True)
        )
        wave.fired.add(literal)
        wave.literals.append(literal)
        wave.hops.append(hops)
        wave.credit.append(shares[0])
        wave.pulses += len(targets)

    def _finish(self) -> None:
        """Send one report for each wave touched of which no more is due."""
        for wave in self._touched.values():
            if len(wave.seen) < wave.due:
                continue
            report = wire.CellReport(
                wave=wave.number,
                cell=self.cell,
                part=wave.part,
                literals=tuple(wave.literals),
                hops=tuple(wave.hops),
                credit=tuple(wave.credit),
                pulses=wave.pulses,
                epoch=self._epoch,
            )
            wave.part += 1
            wave.literals, wave.hops, wave.credit, wave.pulses = [], [], [], 0
            self._out.append(report)
        self._touched = {}

    # Observations and wirings --------------------------------------------------------

    def _observe(self, observation: wire.Observation) -> None:
        size = len(observation.bits)
        if size <= self.cell // 8:
            rule = f"must hold sensor {self.cell}"
            raise MessageError(f"observation: {rule}, got {size} bytes")
        if not self._is_new(observation):
            return
        self._readings.keep(observation.tick, observation)
        self._history.observe(observation.tick, self._read(observation))
        for wave in list(self._waves.values()):
            if wave.start is not None and wave.start.tick == observation.tick:
                self._open(wave)

    def _rewire(self, wiring: wire.Wiring) -> None:
        if wiring.cell != self.cell:
            raise MessageError(f"wiring: must be for this cell, got {wiring.cell}")
        most = max(len(wiring.add), len(wiring.add_complement))
        if most > DEEPEST:
            rule = f"must have up to {DEEPEST} targets"
            raise MessageError(f"wiring: {rule}, got {most}")
        # A wave fences every wiring, so wiring numbers grow no faster than waves.
        check_number("wiring: epoch", wiring.epoch, self._fence)
        if not self._changes(wiring):
            return
        own, complement = 2 * self.cell, 2 * self.cell + 1
        for literal, add, drop in (
            (own, wiring.add, wiring.drop),
            (complement, wiring.add_complement, wiring.drop_complement),
        ):
            kept = set() if wiring.after == 0 else set(self._targets[literal])
            self._targets[literal] = sorted((kept - set(drop)) | set(add))


def _is_on(packed: bytes, sensor: int) -> int:
    """Return a bit of a mask; 0 where it has none."""
    byte = sensor >> 3
    return packed[byte] >> (sensor & 7) & 1 if byte < len(packed) else 0
