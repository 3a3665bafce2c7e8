"""What is reported of a run while it is under way."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from neurosnap.agent.growth.changed import Changed
from neurosnap.health.news import Standing


class Restart(msgspec.Struct, frozen=True):
    """One time that a run went on after a part had died."""

    why: str
    """Which part died, and how."""
    tick: int
    """The last whole tick, which it went on from."""
    lost: int
    """Completed ticks that the recording lacks."""
    outside: bool = False
    """The lost ticks were read from a live source, so they cannot be repeated."""
    kept: tuple[str, ...] = ()
    """Files that it could not go on from, which are kept beside the recording."""


def _ignore(_: object) -> None:
    """Do nothing."""


@dataclass(frozen=True)
class Watcher:
    """Functions that are called while a run is under way, all on the event loop.

    An exception that one of them raises ends the run, and is raised by it.
    """

    on_tick: Callable[[int], None] = _ignore
    """Called with the tick once all parts are up: with every tick of an inline run,
    otherwise at most twenty times a second. Four times a second while no tick comes and
    no deadline has passed."""
    on_change: Callable[[Changed], None] = _ignore
    """Called with each sensor that is grown or retired, except by the decision of the
    last tick, which nothing follows."""
    on_health: Callable[[Standing], None] = _ignore
    """Called with the health of a home's sensors, when that is new."""
    on_restart: Callable[[Restart], None] = _ignore
    """Called when the run goes on after a part has died."""


SILENT = Watcher()
"""Nothing is reported."""
