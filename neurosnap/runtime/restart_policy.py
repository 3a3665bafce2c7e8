"""The policy of restarts: when, how often, and after which delay."""

import time
from collections import deque
from collections.abc import Callable
from typing import Annotated, Literal, TypeAlias

import msgspec

from neurosnap.protocol.option import option

RestartKind: TypeAlias = Literal["never", "on-failure", "always"]


class Supervision(msgspec.Struct, frozen=True, kw_only=True):
    """What happens when a part dies."""

    restart: Annotated[
        RestartKind,
        option(
            "When to start the parts again and go on from the recording. On-failure: when"
            " one was killed, vanished or hangs, and not when one gave an error, since it"
            " would give the same again. Always: then, too.",
        ),
    ] = "on-failure"
    max_restarts: Annotated[
        int,
        option(
            "How many restarts there may be within `restart_window` before the run is"
            " given up.",
            ge=0,
        ),
    ] = 10
    restart_window: Annotated[
        float,
        option(
            "How long a restart counts towards `max_restarts`.", unit="SECONDS", gt=0
        ),
    ] = 600.0
    backoff: Annotated[
        float,
        option(
            "How long to wait before a restart. Twice as long each time when no tick was"
            " made in between.",
            unit="SECONDS",
            ge=0,
        ),
    ] = 0.1


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
