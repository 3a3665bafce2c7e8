"""The coordinator's side of the network: wirings sent, and waves in flight.

A wave has settled once all of its credit is back, as `neurosnap.protocol.wave` counts
it. A wiring goes out as the change against what the cell was told before; a wave that
is given up is repeated under a new number after every cell has got its whole wiring
again, because a change that was lost must not live on.

Pure: edges and reports in, messages out.
"""

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError
from neurosnap.protocol.round import Round
from neurosnap.protocol.sent_wiring import Edges, SentWiring
from neurosnap.protocol.wave import Wave

_UNANNOUNCED = 64  # most waves in a row that are not announced to all cells


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
        """Return the messages that turn the cells' wiring into `edges`.

        Args:
            edges: As of `SentWiring.rewire`.
        """
        messages = self.wiring.rewire(edges)
        self._stale = self._stale or bool(messages)  # the next wave is a fence
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
        wave = Wave(number, tick, kind, seeds, signal, repeats)
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
