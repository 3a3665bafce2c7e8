"""The sensors that a method flags in a home, each with a stretch of time."""

from typing import NamedTuple, Protocol

from tools.paper.homes.home import Home

HOUR = 3600.0


class Mention(NamedTuple):
    """A sensor that a method names as broken, and from when to when."""

    sensor: int
    begin: float
    """Seconds since 1970."""
    end: float


class Method(Protocol):
    """A way to find broken sensors, as it was learned from the past of a home."""

    def mentions(self, home: Home, begin: float, end: float) -> list[Mention]:
        """Return the sensors named in a stretch of time, in order of their beginnings.

        Args:
            home: With faults, if any, from `begin` on.
            begin: Seconds since 1970; a start of a segment.
            end: Its end, or that of a longer stretch.
        """

    def since(self, home: Home, sensor: int, begin: float, end: float) -> float | None:
        """Return when a sensor is first named in a stretch; None: it is not.

        It was well at `begin`, and others are as they were.
        """


def joined(points: list[tuple[float, int]], lasting: float) -> list[Mention]:
    """Return the mentions that single moments make: each lasts until an hour without.

    Args:
        points: Times and sensors, in order of time.
        lasting: Seconds that a single one lasts by itself.
    """
    open_: dict[int, Mention] = {}
    done: list[Mention] = []
    for time, sensor in points:
        now = open_.get(sensor)
        if now is not None and time - now.end <= HOUR:
            open_[sensor] = now._replace(end=time + lasting)
            continue
        if now is not None:
            done.append(now)
        open_[sensor] = Mention(sensor, time, time + lasting)
    return sorted([*done, *open_.values()], key=lambda mention: mention.begin)
