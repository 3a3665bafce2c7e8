"""Helpers for tests of waves: starting literals, shares of credit, number encoding."""

from fractions import Fraction

from neurosnap import wire

LARGEST = 2**31 - 1
"""The largest number that a message may hold."""


def start(
    wave: int = 1, *signal: int, credit: int = 0, below: int = 1
) -> wire.WaveStart:
    """Announce a wave to all."""
    return wire.WaveStart(wave, 0, "signal", credit, below, signal, fence=wave)


def state_wave(wave: int, tick: int, *signal: int, credit: int = 0) -> wire.WaveStart:
    """Announce a state wave to all."""
    return wire.WaveStart(wave, tick, "state", credit, 1, signal, fence=wave)


def share(credit: int) -> Fraction:
    """Return the share of a wave that an exponent of credit stands for."""
    return Fraction(1, 2**credit)


def packed(*numbers: int) -> bytes:
    """Return numbers as a message between workers has them."""
    return b"".join(number.to_bytes(4, "little", signed=True) for number in numbers)
