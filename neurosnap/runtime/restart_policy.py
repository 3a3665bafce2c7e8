"""The policy of restarts: when, how often, and after which delay."""

import time
from collections import deque
from collections.abc import Callable
from typing import Annotated, Literal, TypeAlias

import msgspec

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.protocol.option import option

_LONGEST = 30.0  # seconds

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
    """Decides whether a run goes on after an error, and after which delay.

    Args:
        supervision: The policy.
        clock: Seconds that only grow.
    """

    def __init__(
        self, supervision: Supervision, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._policy = supervision
        self._clock = clock
        self._recent: deque[float] = deque()
        self._delay = supervision.backoff

    def allow(self, error: SwarmError) -> bool:
        """Return whether there is a restart after this error, and count it if so."""
        if self._policy.restart == "never":
            return False
        if self._policy.restart == "on-failure" and not isinstance(
            error, PartDiedError
        ):
            return False
        now = self._clock()
        while self._recent and now - self._recent[0] >= self._policy.restart_window:
            self._recent.popleft()
        if len(self._recent) >= self._policy.max_restarts:
            return False
        self._recent.append(now)
        return True

    def delay(self, *, gained: bool) -> float:
        """Return the seconds to wait before a restart.

        Args:
            gained: Whether the run made a tick since the restart before.
        """
        longer = min(2 * self._delay, _LONGEST)
        self._delay = self._policy.backoff if gained else longer
        return self._delay
