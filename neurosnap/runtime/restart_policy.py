"""The policy of restarts: when, how often, and after which delay."""

import time
from collections import deque
from collections.abc import Callable
from typing import Annotated, Literal, TypeAlias

import msgspec

RestartKind: TypeAlias = Literal["never", "on-failure", "always"]


class Supervision(msgspec.Struct, frozen=True, kw_only=True):
    """What happens when a part dies."""

    restart: RestartKind = "on-failure"
    """Whether the run goes on. ``on-failure``: when a part was killed, vanished or does
    not answer, and not when one says why it cannot go on, since it would say the same
    again. ``always``: then, too."""
    max_restarts: Annotated[int, msgspec.Meta(ge=0)] = 10
    """How often within `restart_window`, before the run is given up."""
    restart_window: Annotated[float, msgspec.Meta(gt=0)] = 600.0
    """Seconds."""
    backoff: Annotated[float, msgspec.Meta(ge=0)] = 0.1
    """Seconds before a restart; twice as many each time no tick was gained."""


class Restarts:
    """Counts restarts by what there may be: so many within so many seconds.

    Args:
        supervision: Says how many.
        clock: Seconds that only grow.
    """

    def __init__(
        self, supervision: Supervision, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._most = supervision.max_restarts
        self._window = supervision.restart_window
        self._clock = clock
        self._recent: deque[float] = deque()

    def allow(self) -> bool:
        """Return whether there may be one more now, and count it if so."""
        now = self._clock()
        while self._recent and now - self._recent[0] >= self._window:
            self._recent.popleft()
        if len(self._recent) >= self._most:
            return False
        self._recent.append(now)
        return True
