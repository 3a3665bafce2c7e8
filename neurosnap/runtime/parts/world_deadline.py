"""The deadline of the world's next observation."""

import logging
import time

from neurosnap import wire
from neurosnap.errors import PartDiedError

_log = logging.getLogger(__name__)

_WARNED = 1 / 3  # of its time is over when the world is named as who is waited for


class WorldDeadline:
    """A deadline for the world's next observation.

    Only what the coordinator says is needed: a decision asks the world for an
    observation, and the first wave of a tick shows that this has come.

    Args:
        patience: Seconds it may take; None: as long as it takes.
    """

    def __init__(self, patience: float | None) -> None:
        self._patience = patience
        self._tick: int | None = None  # of the decision that is not answered
        self._since = 0.0
        self._warned = False

    def heed(self, message: wire.Message) -> None:
        """Take in what the coordinator has just said."""
        match message:
            case wire.Decision(tick=tick):
                self._tick, self._since = tick, time.monotonic()
                self._warned = False
            case wire.WaveStart():
                self._tick = None
            case _:
                pass

    def check(self) -> None:
        """Say who is waited for, once it takes long.

        Raises:
            PartDiedError: It takes longer than it may: who hangs is as good as dead.
        """
        if self._patience is None or self._tick is None:
            return
        waited = time.monotonic() - self._since
        if waited > self._patience:
            rule = f"must answer the decision of tick {self._tick}"
            raise PartDiedError(
                f"world: {rule} within {self._patience:g} s, got nothing"
            )
        if waited > self._patience * _WARNED and not self._warned:
            self._warned = True
            _log.warning("waiting for world: tick %d, %.1f s", self._tick + 1, waited)
