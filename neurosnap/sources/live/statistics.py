"""Counters of a live source: received, used, rejected, lost."""

import msgspec


class Statistics(msgspec.Struct, frozen=True):
    """The counts of one source, since it was made."""

    ticks: int
    """Observations given out."""
    taken: int
    """Readings taken; a whole one counts one for each sensor."""
    coalesced: int
    """Of single readings, those another replaced before any tick could show them."""
    late: int
    """Readings dropped because a younger one was there."""
    ahead: int
    """Readings stamped by a clock that is ahead."""
    refused: int
    """What was no reading, or of no sensor here."""
    dropped: int
    """Whole readings that lost their tick because too many waited."""
    skipped: int
    """Ticks that were due and not given; see `Clocked`."""
    missing: int = 0
    """Readings that the journal should hold and does not, since it was damaged."""

    @property
    def losses(self) -> str:
        """What got lost or came at a wrong time, in words; empty: nothing did."""
        counts = {
            "whole readings dropped": self.dropped,
            "readings missing from the journal": self.missing,
            "late readings dropped": self.late,
            "readings from a clock that is ahead": self.ahead,
            "ticks skipped": self.skipped,
        }
        return ", ".join(f"{count} {what}" for what, count in counts.items() if count)
