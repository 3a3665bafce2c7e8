"""Detects when a wave has settled: all the credit in its messages has come back.

A wave starts with credit 1. Every pulse and every report carries a share, and a cell
sends on exactly what it got, so the credit in the reports and the credit still under
way always add up to 1: the wave has settled exactly when the reports hold all of it
(weight throwing). No clock, no counting of messages, right under any order.
"""

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TypeAlias

import numpy as np

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import DEEPEST
from neurosnap.protocol.worker_edges import ints
from neurosnap.protocol.worker_kernels import Ints

Naturals: TypeAlias = list[int] | Ints
"""A cell reports two literals at most: of so few a list is quicker than an array."""
_SHOWN = 200  # characters of a report in an error


class Wave:
    """A wave under way or settled.

    Args:
        number: Its number.
        tick: The tick it belongs to; 0 for none.
        kind: ``state`` or ``signal``.
        seeds: How many literals fire at the start.
        sensors: How many cells there are.
        signal: Those literals; may be empty in a state wave, where each of `seeds`
            cells whose reading is known fires it.
        repeats: The number of the wave given up for this one; 0 for none.

    Attributes:
        reached: ``(2N,)`` bool: the literals that were reported to have fired.
        depth: Hops until the last of them was first reached, as reported.
        pulses: Pulses that it took, as reported.
    """

    def __init__(
        self,
        number: int,
        tick: int,
        kind: wire.WaveKind,
        seeds: int,
        sensors: int,
        signal: tuple[int, ...] = (),
        repeats: int = 0,
    ) -> None:
        self.number = number
        self.tick = tick
        self.kind = kind
        self.seeds = seeds
        self.signal = signal
        self.repeats = repeats
        self.reached = np.zeros(2 * sensors, np.bool_)
        self.depth = self.pulses = 0
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
        who = cells.start
        seen = self._reports.get(who)
        if seen is not None and report.part in seen:
            return
        literals, hops = fired(report)
        few = isinstance(hops, list)
        depth = max(hops, default=0) if few else int(np.max(hops, initial=0))
        self._check(report, cells, literals, hops, depth)
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
        if len(literals):
            self.reached[literals] = True
        self.depth = max(self.depth, depth)
        self.pulses += report.pulses

    def _check(
        self,
        report: wire.CellReport | wire.WorkerReport,
        cells: range,
        literals: Naturals,
        hops: Naturals,
        depth: int,
    ) -> None:
        credit = report.credit
        each = -(-report.pulses // len(cells))
        most = max(report.part, each, depth, *credit, len(credit))
        if not credit or most > DEEPEST:
            raise MessageError(
                f"{wire.topic(report.key)}: must give back credit, and hold numbers up to {DEEPEST},"
                f" got {_named(report)}, {len(credit)} shares, largest {most}"
            )
        # Most reports of cells name no literal, and only give credit back.
        if (
            report.wave != self.number
            or len(literals) != len(hops)
            or (len(literals) and not self._are_new(literals, hops, cells))
        ):
            raise MessageError(
                f"{wire.topic(report.key)}: must report on wave {self.number}, own literals, each"
                f" once, got {report!r:.{_SHOWN}}"
            )

    def _are_new(self, literals: Naturals, hops: Naturals, cells: range) -> bool:
        """Tell whether literals are of `cells`, each once, and not reported before."""
        own = range(2 * cells.start, 2 * cells.stop)
        if isinstance(literals, list):
            once = len({*literals}) == len(literals)
            fresh = all(a in own and not self.reached[a] for a in literals)
            return once and fresh and min(hops) >= 0
        if np.min(hops) < 0 or literals.min() < own.start or literals.max() >= own.stop:
            return False
        named = self.reached[own.start : own.stop].copy()
        before, named[literals - own.start] = named.sum(), True
        return bool(named.sum() == before + len(literals))

    @property
    def is_settled(self) -> bool:
        """Whether all credit is back."""
        return self._missing == 0

    @property
    def missing(self) -> Fraction:
        """The share of the credit that is not back yet, in [0, 1]."""
        return Fraction(self._missing, 1 << self._scale)

    def silent(
        self, signal: Iterable[int], targets: Callable[[int], Iterable[int]]
    ) -> list[int]:
        """Return the cells that owe a report, for the error that names them.

        They were asked to fire, or are the targets of what fired.
        """
        expected = set(signal)
        reached = np.flatnonzero(self.reached).tolist()
        for literal in reached:
            expected.update(targets(literal))
        # By literal, not by cell: a cell may have reported its other literal only.
        return sorted({literal >> 1 for literal in expected.difference(reached)})


def _named(report: wire.CellReport | wire.WorkerReport) -> str:
    """Return whose report it is, as in ``cell 3``."""
    return report.sender.replace("/", " ")


def fired(report: wire.CellReport | wire.WorkerReport) -> tuple[Naturals, Naturals]:
    """Return the literals that fired, and the hops of each, by a report.

    Raises:
        MessageError: There is a part of a number in it.
    """
    if isinstance(report, wire.CellReport):
        return [*report.literals], [*report.hops]
    literals = ints("workerreport: literals", report.literals)
    return literals, ints("workerreport: hops", report.hops)
