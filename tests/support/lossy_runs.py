"""Runs recorded in the order that a seed draws, with messages lost on their way."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from neurosnap import wire
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions
from tests.golden.drive import drive, record
from tests.support.replayed_runs import readings
from tests.support.scripted_sources import Scripted

Lost: TypeAlias = Callable[[wire.Message], bool]


def lossy_run(
    options: RunOptions,
    log: Path,
    seed: int,
    lost: Lost | None = None,
    stop: Callable[[Coordinator], bool] = lambda _: False,
) -> Coordinator:
    """Record a run; return its coordinator.

    Args:
        options: What to run; it reads `readings`.
        log: Where to record. What is lost is recorded.
        seed: Draws the order of the messages.
        lost: The first message to a cell of which this is true is lost, and a wave that
            is stuck for it is declared late; None if none is.
        stop: The run is asked to stop as soon as this is true.
    """
    left = lost

    def loses(who: str, message: wire.Message) -> bool:
        nonlocal left
        if left is None or not who.startswith("cell/") or not left(message):
            return False
        left = None
        return True

    driven = drive(options, Scripted(readings()), seed, lost=loses, stop=stop)
    record(driven, options, log)
    return driven.core


LOST: dict[str, Lost] = {
    "pulse": lambda m: isinstance(m, wire.Pulse) and m.wave > 20,
    "start": lambda m: isinstance(m, wire.WaveStart) and m.wave > 20,
}
