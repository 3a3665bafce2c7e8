"""Maps times since the epoch to a monotonic clock."""

from neurosnap.sources.live.latest_readings import TOLERANCE


class ClockMapping:
    """Converts stamps; equal ones stay equal, and in order they stay in order.

    The difference of the two clocks is kept until it is clearly another one, because
    somebody put the wall clock right: taken anew for each stamp it would jitter, and so
    put equal ones in some order.

    Args:
        now: The clock that never goes back.
        wall: Seconds since the epoch, at the same moment.
    """

    def __init__(self, now: float, wall: float) -> None:
        self._offset = now - wall

    def on_our_clock(self, at: float, now: float, wall: float) -> float:
        """Return what our clock showed at `at`, in seconds since the epoch."""
        offset = now - wall
        if abs(offset - self._offset) > TOLERANCE:
            self._offset = offset
        return at + self._offset
