"""Evidence for and against one implication, now and over time."""

from collections.abc import Iterator

import msgspec

from neurosnap.apps.viewer.api import Edge, Weighed
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.poc.learning.kinds import Snapshot

_AROUND = 500
"""Ticks before and after the one asked for that are learned through again."""
_NEAR = 100
_FAR = 100
"""Points of these ticks, and of the key-frames."""


def weighed(run_view: RunView, source: int, target: int, tick: int) -> Edge:
    """Return what is known of ``source -> target`` at a tick and around it.

    Cost: the learning of a thousand ticks, and the reading of a hundred key-frames.

    Raises:
        InvalidValueError: There is no such tick, no such literal, or both are of one
            sensor.
        RecordingError: An observation or a key-frame that is needed is not there.
    """
    now = _weigh(tick, run_view.snapshot(tick), source, target)
    around = {each.tick: each for each in _far(run_view, source, target)}
    around |= {each.tick: each for each in _near(run_view, source, target, tick)}
    around[tick] = now
    over = [around[each] for each in sorted(around)]
    return Edge(source=source, target=target, over=over, **msgspec.structs.asdict(now))


def _weigh(tick: int, snapshot: Snapshot, source: int, target: int) -> Weighed:
    found = snapshot.evidence(source, target)
    return Weighed(
        tick=tick,
        weights=(found.both, found.against, found.other, found.neither),
        threshold=found.limit,
        total=found.total,
        holds=found.holds,
        since=found.since,
    )


def _near(run_view: RunView, source: int, target: int, tick: int) -> Iterator[Weighed]:
    """Yield ticks around one, evenly apart, as far as they can be learned."""
    first = max(run_view.first, tick - _AROUND)
    last = min(run_view.last, tick + _AROUND)
    apart = max(1, -(-(last - first + 1) // _NEAR))
    try:
        for learned in run_view.recall.walk(first, last):
            if (learned.tick - tick) % apart == 0:
                yield _weigh(learned.tick, learned.snapshot, source, target)
    except RecordingError:
        return  # what is known by then is shown


def _far(run_view: RunView, source: int, target: int) -> Iterator[Weighed]:
    """Yield key-frames, evenly apart."""
    for frame in run_view.tick_index.keyframes(_FAR):
        try:
            snapshot = run_view.recall.weigh(frame)
        except (RecordingError, InvalidValueError):
            continue
        yield _weigh(frame.tick, snapshot, source, target)
