"""One wave, as the coordinator sees it: what it reached, and whether it has settled.

A wave starts with credit 1. Every pulse and every report carries a share, and a cell
sends on exactly what it got, so the credit in the reports and the credit still under
way always add up to 1: the wave has settled exactly when the reports hold all of it
(weight throwing). No clock, no counting of messages, right under any order.
"""

from collections.abc import Callable, Iterable
from fractions import Fraction

from neurosnap import wire
from neurosnap.errors import MessageError


class Wave:
    """A wave under way or settled.

    Args:
        number: Its number.
        tick: The tick it belongs to; 0 for none.
        kind: ``state`` or ``signal``.
        seeds: How many literals fire at the start.
        signal: Those literals; may be empty in a state wave, where each of `seeds`
            cells fires its own reading.
        repeats: The number of the wave given up for this one; 0 for none.
    """

    def __init__(
        self,
        number: int,
        tick: int,
        kind: wire.WaveKind,
        seeds: int,
        signal: tuple[int, ...] = (),
        repeats: int = 0,
    ) -> None:
        self.number = number
        self.tick = tick
        self.kind = kind
        self.signal = signal
        self.repeats = repeats
        self.hops: dict[int, int] = {}
        self.pulses = 0
        self._reports: dict[int, set[int]] = {}  # cell -> parts seen
        # Every seed gets 2^-credit; what that leaves of 1 is never given out. Missing
        # is counted in units of 2^-scale: shares are as small as the wave is deep.
        self.credit = max(seeds - 1, 0).bit_length()
        self._scale = self.credit
        self._missing = seeds

    def start(self, settled_below: int, fence: int, cell: int = -1) -> wire.WaveStart:
        """Return the message that begins it, for one cell or for all.

        Args:
            settled_below: As in the message.
            fence: The last wave announced to all; this one where `cell` is -1.
            cell: The cell the copy is for.
        """
        return wire.WaveStart(
            wave=self.number,
            tick=self.tick,
            kind=self.kind,
            credit=self.credit,
            settled_below=settled_below,
            signal=self.signal,
            repeats=self.repeats,
            fence=fence,
            cell=cell,
        )

    def report(self, settled: wire.Settled) -> None:
        """Take in one cell's report; one that came before changes nothing.

        Raises:
            MessageError: The report cannot be right: it is of another wave, names
                literals of another cell, a literal twice, or gives back more credit
                than there is. The wave is left as it was.
        """
        parts = self._reports.get(settled.cell, set())
        if settled.part in parts:
            return
        self._check(settled)
        scale = max((self._scale, *settled.credit))
        missing = self._missing << (scale - self._scale)
        missing -= sum(1 << (scale - exponent) for exponent in settled.credit)
        if missing < 0:
            raise MessageError(
                f"settle: must give back at most the credit given out, got cell"
                f" {settled.cell}, credit {list(settled.credit)}"
            )
        self._scale, self._missing = scale, missing
        self._reports.setdefault(settled.cell, set()).add(settled.part)
        self.hops.update(zip(settled.literals, settled.hops, strict=True))
        self.pulses += settled.pulses

    def _check(self, settled: wire.Settled) -> None:
        literals = settled.literals
        if (
            settled.wave != self.number
            or len(literals) != len(settled.hops)
            or len(set(literals)) != len(literals)
            or any(literal >> 1 != settled.cell for literal in literals)
            or any(literal in self.hops for literal in literals)
        ):
            raise MessageError(
                f"settle: must report on wave {self.number}, own literals, each once,"
                f" got {settled}"
            )

    @property
    def is_settled(self) -> bool:
        """Whether all credit is back."""
        return self._missing == 0

    @property
    def missing(self) -> Fraction:
        """The share of the credit that is not back yet, in [0, 1]."""
        return Fraction(self._missing, 1 << self._scale)

    @property
    def depth(self) -> int:
        """Hops until the last literal reached was first reached, as reported."""
        return max(self.hops.values(), default=0)

    def silent(
        self, signal: Iterable[int], targets: Callable[[int], Iterable[int]]
    ) -> list[int]:
        """Return the cells that owe a report, for the error that names them.

        Args:
            signal: The literals that were asked to fire.
            targets: The out-edges of a literal; what fired must have pulsed these.
        """
        expected = set(signal)
        for literal in self.hops:
            expected.update(targets(literal))
        # By literal, not by cell: a cell may have reported its other literal only.
        return sorted({literal >> 1 for literal in expected - self.hops.keys()})
