"""Detects when a wave has settled: all the credit in its messages has come back.

A wave starts with credit 1. Every pulse and every report carries a share, and a cell
sends on exactly what it got, so the credit in the reports and the credit still under
way always add up to 1: the wave has settled exactly when the reports hold all of it
(weight throwing). No clock, no counting of messages, right under any order.
"""

from collections.abc import Callable, Iterable
from fractions import Fraction

from neurosnap import wire
from neurosnap.errors import MessageError

DEEPEST = 1 << 17
"""The most hops of a wave, bits of a share of its credit, and things in a report.

Each literal fires once a wave, so a wave over ``N`` sensors has at most ``2N`` hops and
its shares, split among at most ``2N`` each time, less than ``2N·log2(2N + 1)`` bits:
this does for 5,000 sensors in the worst order there is, and for a chain of 65,000. What
claims more would have to be computed with numbers of that many bits."""
_SHOWN = 200  # characters of a report in an error


class Wave:
    """A wave under way or settled.

    Args:
        number: Its number.
        tick: The tick it belongs to; 0 for none.
        kind: ``state`` or ``signal``.
        seeds: How many literals fire at the start.
        signal: Those literals; may be empty in a state wave, where each of `seeds`
            cells whose reading is known fires it.
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
        self.seeds = seeds
        self.signal = signal
        self.repeats = repeats
        self.hops: dict[int, int] = {}
        self.pulses = 0
        self._reports: dict[int, set[int]] = {}  # first cell -> parts of its reports
        # Every seed gets 2^-credit; what that leaves of 1 is never given out. Missing
        # is counted in units of 2^-scale: shares are as small as the wave is deep.
        self.credit = max(seeds - 1, 0).bit_length()
        self._scale = self.credit
        self._missing = seeds

    def start(self, settled_below: int, fence: int, cell: int = -1) -> wire.WaveStart:
        """Return the message that begins it, for one cell or for all.

        The fence is the last wave announced to all; this one where `cell` is -1.
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

    def report(self, report: wire.CellReport | wire.WorkerReport, cells: range) -> None:
        """Count a report; one that came before changes nothing.

        Args:
            report: A cell's, or a worker's.
            cells: The cells that it speaks for.

        Raises:
            MessageError: The report cannot be right: it is of another wave, names
                literals of other cells, a literal twice, gives back no credit or more
                than there is, or is larger than `DEEPEST`. The wave is left as it was.
        """
        literals, hops = wire.fired(report)
        who = cells.start
        seen = self._reports.get(who)
        if seen is not None and report.part in seen:
            return
        self._check(report, cells, literals, hops)
        scale = max(self._scale, *report.credit)
        missing = self._missing << (scale - self._scale)
        for exponent in report.credit:
            missing -= 1 << (scale - exponent)
        if missing < 0:
            raise MessageError(
                f"{wire.topic(report.key)}: must give back at most the credit given out, got"
                f" {_named(report)}, credit {list(report.credit)!r:.{_SHOWN}}"
            )
        self._scale, self._missing = scale, missing
        if seen is None:
            self._reports[who] = {report.part}
        else:
            seen.add(report.part)
        if literals:
            self.hops.update(zip(literals, hops, strict=True))
        self.pulses += report.pulses

    def _check(
        self,
        report: wire.CellReport | wire.WorkerReport,
        cells: range,
        literals: wire.Naturals,
        hops: wire.Naturals,
    ) -> None:
        credit = report.credit
        each = -(-report.pulses // len(cells))
        most = max(report.part, each, *hops, *credit, len(credit))
        if not credit or most > DEEPEST:
            raise MessageError(
                f"{wire.topic(report.key)}: must give back credit, and hold numbers up to {DEEPEST},"
                f" got {_named(report)}, {len(credit)} shares, largest {most}"
            )
        # Without a loop of its own: a worker reports a hundred thousand at once. Most
        # reports of cells name no literal, and only give credit back.
        if (
            report.wave != self.number
            or len(literals) != len(hops)
            or (literals and not self._is_new(literals, hops, cells))
        ):
            raise MessageError(
                f"{wire.topic(report.key)}: must report on wave {self.number}, own literals, each"
                f" once, got {report!r:.{_SHOWN}}"
            )

    def _is_new(
        self, literals: wire.Naturals, hops: wire.Naturals, cells: range
    ) -> bool:
        """Tell whether literals are of `cells`, each once, and not reported before."""
        return (
            len(set(literals)) == len(literals)
            and min(literals) >= 2 * cells.start
            and max(literals) < 2 * cells.stop
            and min(hops) >= 0
            and self.hops.keys().isdisjoint(literals)
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

        They were asked to fire, or are the targets of what fired.
        """
        expected = set(signal)
        for literal in self.hops:
            expected.update(targets(literal))
        # By literal, not by cell: a cell may have reported its other literal only.
        return sorted({literal >> 1 for literal in expected - self.hops.keys()})


def _named(report: wire.CellReport | wire.WorkerReport) -> str:
    """Return whose report it is, as in ``cell 3``."""
    return report.sender.replace("/", " ")


def split_evenly(credit: int, parts: int) -> list[int]:
    """Split the share ``2^-credit`` into `parts` shares that add up to it exactly.

    They are the leaf depths of a complete binary tree, so they differ by at most one
    and nothing is left over.

    Returns:
        The exponents of the shares, larger shares first.
    """
    depth = (parts - 1).bit_length()
    larger = (1 << depth) - parts
    smaller = parts - larger
    return [credit + depth - 1] * larger + [credit + depth] * smaller
