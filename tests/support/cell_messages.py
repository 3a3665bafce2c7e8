"""The cell of sensor 1, what it is told, and what it sends.

Its literals are 2 and 3.
"""

from collections.abc import Sequence
from fractions import Fraction

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from neurosnap.sensorium import pack
from tests.support.wave_messages import share

OWN, COMPLEMENT = 2, 3


def wired(*targets: int, complement: Sequence[int] = ()) -> Cell:
    """Return the cell of sensor 1 with out-edges."""
    cell = Cell(1)
    wiring = wire.Wiring(1, 1, 0, add=targets, add_complement=tuple(complement))
    assert cell.receive([wiring]) == []
    return cell


def ask(wave: int, fence: int, *signal: int, credit: int = 0) -> wire.Message:
    """Start a wave that only those of its signal are told of."""
    return wire.WaveStart(wave, 0, "signal", credit, 1, signal, fence=fence, cell=1)


def pulse(
    source: int,
    target: int = OWN,
    hops: int = 1,
    credit: int = 3,
    wave: int = 1,
    fence: int | None = None,
) -> wire.Message:
    """Pulse in a wave that was announced to all, unless another fence is given."""
    return wire.Pulse(
        wave, source, target, hops, credit, wave if fence is None else fence
    )


def observation(tick: int, *, on: bool) -> wire.Message:
    return wire.Observation(tick, pack([False, on, False]))


def sent(messages: Sequence[wire.Message]) -> list[wire.Pulse]:
    return [m for m in messages if isinstance(m, wire.Pulse)]


def reports(messages: Sequence[wire.Message]) -> list[wire.CellReport]:
    return [m for m in messages if isinstance(m, wire.CellReport)]


def given_out(messages: Sequence[wire.Message]) -> Fraction:
    """All credit in what a cell sent."""
    pulses = sum((share(p.credit) for p in sent(messages)), Fraction(0))
    back = sum(
        (share(e) for report in reports(messages) for e in report.credit), Fraction(0)
    )
    return pulses + back
