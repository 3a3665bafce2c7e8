"""Puts faults of sensors into the logs of recorded homes."""

import numpy as np
from numpy.random import Generator

from tools.paper.homes.home import Home, Spans, merged

SINGLE = (
    *("fail-stop", "stuck on", "stuck at last", "noise", "spike"),
    *("lost", "obstructed", "moved", "swapped"),
)
LONG = ("fail-stop", "lost", "obstructed", "moved")
SEVERAL = ("fail-stop", "stuck on", "noise")
"""What faults of several sensors at once are drawn from."""
_LOST = {"lost": 0.5, "obstructed": 0.9, "fail-stop": 1.0}
_NOISE = 0.1


def faulty(
    home: Home, kind: str, sensor: int, onset: float, end: float, rng: Generator
) -> Home:
    """Return a home with a fault.

    Args:
        home: Without it.
        kind: One of `SINGLE`.
        sensor: Which sensor.
        onset: When it begins, seconds since 1970.
        end: Until when.
        rng: Draws what is left to chance.
    """
    own = home.spans[sensor]
    if kind in ("moved", "swapped"):
        other = _other(home, sensor, rng)
        changed = {sensor: _spliced(own, home.spans[other], onset, end)}
        if kind == "swapped":
            changed[other] = _spliced(home.spans[other], own, onset, end)
        return home.with_spans(changed)
    return home.with_spans({sensor: _damaged(own, kind, onset, end, rng)})


def _damaged(own: Spans, kind: str, onset: float, end: float, rng: Generator) -> Spans:
    inside = (own[:, 0] >= onset) & (own[:, 0] < end)
    if kind in _LOST:
        gone = inside & (rng.random(len(own)) < _LOST[kind])
        left = own[~gone].copy()
        if kind == "fail-stop":
            left[:, 1] = np.where(
                left[:, 0] < onset, left[:, 1].clip(max=onset), left[:, 1]
            )
        return left
    if kind == "stuck on":
        return merged(np.vstack([own, [[onset, end]]]))
    if kind == "stuck at last":
        on = bool(((own[:, 0] < onset) & (own[:, 1] > onset)).any())
        return _damaged(own, "stuck on" if on else "fail-stop", onset, end, rng)
    if kind == "noise":
        minutes = np.arange(onset, end - 60, 60)
        flipped = minutes[rng.random(len(minutes)) < _NOISE]
        return differing(own, np.column_stack([flipped, flipped + 60]))
    return with_false(own, int(rng.integers(1, 4)), onset, end, rng)


def with_false(
    own: Spans, count: int, begin: float, end: float, rng: Generator
) -> Spans:
    """Return the spans of a sensor with false ones, each as long as a true one was.

    Args:
        own: Its spans.
        count: How many to add.
        begin: From when on; their durations are of spans before.
        end: Until when.
        rng: Draws times and durations.
    """
    before = own[own[:, 0] < begin]
    lengths = (before[:, 1] - before[:, 0]) if len(before) else np.ones(1)
    starts = rng.uniform(begin, end, count)
    stops = np.minimum(starts + np.minimum(rng.choice(lengths, count), 600), end)
    return merged(np.vstack([own, np.column_stack([starts, stops])]))


def differing(one: Spans, other: Spans) -> Spans:
    """Return when exactly one of two sensors is on."""
    bounds, times = np.unique(
        np.concatenate([one.ravel(), other.ravel()]), return_counts=True
    )
    return np.asarray(bounds[times % 2 == 1].reshape(-1, 2))


def _spliced(own: Spans, other: Spans, onset: float, end: float) -> Spans:
    """Return one sensor's spans, with those of another from `onset` until `end`."""
    kept = own[(own[:, 0] < onset) | (own[:, 0] >= end)].copy()
    kept[:, 1] = np.where(kept[:, 0] < onset, kept[:, 1].clip(max=onset), kept[:, 1])
    came = other[(other[:, 0] >= onset) & (other[:, 0] < end)]
    return merged(np.vstack([kept, came]))


def _other(home: Home, sensor: int, rng: Generator) -> int:
    """Return another sensor, drawn among those that came on at least once in ten."""
    counts = np.array([len(spans) for spans in home.spans])
    fit = np.flatnonzero(counts >= max(1, counts[sensor] // 10))
    return int(rng.choice(fit[fit != sensor] if len(fit) > 1 else fit))


def affected(home: Home, other: Home) -> tuple[int, ...]:
    """Return the sensors whose spans differ between two versions of a home."""
    pairs = zip(home.spans, other.spans, strict=True)
    return tuple(s for s, (a, b) in enumerate(pairs) if not np.array_equal(a, b))
