"""Messages found in a recording."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import Verdict, verify

M = TypeVar("M")


def of_type(log: Path, kind: type[M]) -> list[M]:
    messages = (recorded.message for recorded in Recording.open(log).messages())
    return [message for message in messages if isinstance(message, kind)]


def first(
    recorded: Sequence[Recorded], kind: type[M], found: Callable[[M], bool]
) -> tuple[int, M]:
    for place, each in enumerate(recorded):
        if isinstance(each.message, kind) and found(each.message):
            return place, each.message
    raise LookupError(f"no {kind.__name__} like that")


def assert_true_run(log: Path, tick: int = 0, *, ticks: int | None = None) -> Verdict:
    """Check that a run is whole, and derived again the same.

    Args:
        log: Its recording.
        tick: As in `verify`.
        ticks: How many are compared, if that matters.
    """
    verdict = verify(log, tick)
    assert (verdict.difference, verdict.same) == (None, True)
    assert verdict.complete
    assert verdict.ticks == (verdict.ticks if ticks is None else ticks)
    return verdict
