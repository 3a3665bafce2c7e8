"""The waves of a range of ticks, from the cells' reports.

Whether a wave has settled is found as the coordinator finds it, by the credit that came
back: a wave that was given up, or whose reports were lost, shows as one that has not.
There may be thousands of reports on a tick, so all that is done with one is to add it
up; what the coordinator refused for being impossible is left out at the end.
"""

from collections.abc import Iterable
from contextlib import suppress

from neurosnap import wire
from neurosnap.apps.viewer import api
from neurosnap.errors import MessageError
from neurosnap.protocol.wave import DEEPEST


class _Found:
    """What was reported on one wave."""

    def __init__(self) -> None:
        self.hops: dict[int, int] = {}
        self.credit: list[int] = []
        self.pulses = 0


class Waves:
    """Waves by tick, filled with what was recorded, in any order.

    Args:
        sensors: How many there are.
    """

    def __init__(self, sensors: int) -> None:
        self._literals = range(2 * sensors)
        self._starts: dict[int, dict[int, wire.WaveStart]] = {}  # by tick, by wave
        self._found: dict[int, _Found] = {}

    def begin(self, start: wire.WaveStart) -> None:
        """Take note of a wave; some are announced to many."""
        self._starts.setdefault(start.tick, {}).setdefault(start.wave, start)

    def report(self, reports: Iterable[wire.CellReport]) -> None:
        """Take in what cells reported, on whatever wave."""
        for report in reports:
            found = self._at(report.wave)
            found.hops.update(zip(report.literals, report.hops, strict=False))
            found.credit += report.credit
            found.pulses += report.pulses

    def tally(self, tallies: Iterable[wire.WorkerReport]) -> None:
        """Take in what workers reported, on whatever wave."""
        for tally in tallies:
            found = self._at(tally.wave)
            with suppress(MessageError):  # numbers that are cut off
                hops = wire.numbers("tally: hops", tally.hops)
                found.hops.update(zip(wire.fired(tally), hops, strict=False))
            found.credit += tally.credit
            found.pulses += tally.pulses

    def settled(self, tick: int, observed: tuple[int, ...]) -> bool:
        """Return whether nothing more can come of a tick's waves.

        Args:
            tick: The tick.
            observed: The literals observed at it, which start its state wave.
        """
        starts = self._of(tick)
        given_up = {start.repeats for start in starts}
        return all(
            start.wave in given_up or self._is_settled(start, observed)
            for start in starts
        )

    def reached(self, number: int) -> list[int]:
        """Return the literals that a wave reached, in no order."""
        found = self._found.get(number)
        if found is None:
            return []
        return [literal for literal in found.hops if literal in self._literals]

    def of(self, tick: int, observed: tuple[int, ...]) -> list[api.Wave]:
        """Return the waves of a tick, oldest first; arguments as in `settled`."""
        return [self._shown(start, observed) for start in self._of(tick)]

    def _shown(self, start: wire.WaveStart, observed: tuple[int, ...]) -> api.Wave:
        found = self._at(start.wave)
        hops = self._hops(found)
        return api.Wave(
            wave=start.wave,
            kind=start.kind,
            signal=list(start.signal or observed),
            hops=hops,
            depth=hops[-1][1] if hops else 0,
            pulses=found.pulses,
            settled=self._is_settled(start, observed),
        )

    def _is_settled(self, start: wire.WaveStart, observed: tuple[int, ...]) -> bool:
        """Return whether the shares that came back are those that were given out."""
        shares = self._at(start.wave).credit
        scale = max((start.credit, *shares))
        if not shares or scale > DEEPEST:
            return False
        given = len(start.signal or observed) << (scale - start.credit)
        return sum(1 << (scale - share) for share in shares) == given

    def _hops(self, found: _Found) -> list[tuple[int, int]]:
        """Return the literals reached with their hops, nearest first."""
        known = (hop for hop in found.hops.items() if hop[0] in self._literals)
        return sorted(known, key=lambda hop: (hop[1], hop[0]))

    def _of(self, tick: int) -> list[wire.WaveStart]:
        """Return the announcements of a tick's waves, oldest first."""
        starts = self._starts.get(tick, {})
        return [starts[wave] for wave in sorted(starts)]

    def _at(self, number: int) -> _Found:
        if number not in self._found:
            self._found[number] = _Found()
        return self._found[number]
