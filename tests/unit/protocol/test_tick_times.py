"""What is said of a tick that is behind its readings."""

import pytest
from msgspec.structs import astuple, replace

from neurosnap import wire
from neurosnap.protocol.tick_times import Behind, TickTimes, further

STATE = wire.State(1, 1, b"", False, 0, 0, 0, 0, 0)


def told(*waits: float, due: float, before: float = 0.0) -> Behind | None:
    """Return what is said of tick 2.

    Args:
        waits: Seconds until it is observed, its wave starts, has settled, and until it
            is decided.
        due: When its readings were there; 0: it is not late.
        before: Seconds that the cells took for the tick before.
    """
    times, at = TickTimes(), 1000.0
    seen = wire.Observation(1, b"")
    times.take(seen, at)
    at += before
    times.take(STATE, at)
    assert times.take(wire.Decision(1, -1, ""), at) is None
    late = wire.Observation(2, b"", due=due, waiting=4)
    start = wire.WaveStart(2, 2, "state", 0, 1)
    tick: tuple[wire.Message, ...] = (late, start, replace(STATE, tick=2))
    for message, seconds in zip(tick, waits, strict=False):
        at += seconds
        assert times.take(message, at) is None
        # What cells send meanwhile ends no wait.
        times.take(wire.CellReport(2, 0, 0, (), (), (), 0), at + 0.001)
    return times.take(wire.Decision(2, -1, ""), at + waits[3])


@pytest.mark.parametrize(
    ("waits", "part", "share"),
    [
        ((6.0, 1.0, 2.0, 1.0), "world", 0.6),
        ((1.0, 5.0, 2.0, 2.0), "coordinator", 0.7),
        ((1.0, 1.0, 7.0, 1.0), "cells", 0.7),
    ],
)
def test_the_part_that_took_most_of_the_time_is_named(
    waits: tuple[float, ...], part: str, share: float
) -> None:
    behind = told(*waits, due=1000.0)
    assert behind is not None
    assert astuple(behind) == (2, pytest.approx(waits[0]), 4, part, share)


def test_what_counts_is_the_time_since_the_reading_was_there() -> None:
    behind = told(1.0, 3.0, 1.0, 0.0, due=1060.0, before=60.5)
    assert behind is not None
    assert astuple(behind) == (2, pytest.approx(1.5), 4, "coordinator", 3 / 5.5)
    behind = told(1.0, 3.0, 1.0, 0.0, due=1010.0, before=60.5)
    assert behind is not None
    assert behind.part == "cells"  # of the tick before, for which it had to wait


def test_nothing_is_said_of_a_tick_that_is_not_behind() -> None:
    assert told(9.0, 9.0, 9.0, 9.0, due=0.0) is None


def test_the_furthest_of_some_is_kept() -> None:
    near, far = (Behind(n, float(n), 0, "cells", 1.0) for n in (1, 2))
    assert further(near, far) == further(far, near) == further(far, None) == far
    assert further(None, near) == near
    assert further(None, None) is None
