"""Tells which places look alike that are not, and what tells them apart.

Places look alike where what was done a step before tells much of what follows.

References:
    Not the paper's. To tell places apart by the step before only where that tells what
    follows is McCallum's (1996) utile distinction.
"""

from statistics import NormalDist
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from neurosnap.agent.moves import Moves

HIDDEN: Final = 0.1
"""The share of what is left open that the move before may tell: beyond it places look
alike that are not, and are not to be taken for one."""
SELDOM: Final = 0.02
"""The share of all moves that it may tell all the same: so few are taken for chance."""
_ACCIDENT = 0.01  # the chance that any sensor seems to tell something, and does not


def telling(moves: "Moves", actions: int) -> NDArray[np.bool_]:
    """Return which sensors tell what follows, or are told by what was before: ``(R,)``.

    A coin does neither, and tells no place from another. Each pair of a sensor before
    and one after is tested for independence, action by action, by Pearson's chi-square
    with one degree of freedom; all of them seem independent with a chance of 0.99 where
    they are. A sensor that tells something together with another only is missed.
    """
    size = moves.before.shape[1]
    largest = np.zeros((size, size))
    for action in range(actions):
        mine = moves.action == action
        before, after = moves.before[mine], moves.after[mine]
        x, y = (on.sum(axis=0, dtype=np.float64) for on in (before, after))
        # Of so few moves a count is exact in single precision, in any order.
        both = before.astype(np.float32).T @ after.astype(np.float32)
        count, both = len(before), both.astype(np.float64)
        spread = np.outer(x * (count - x), y * (count - y))
        excess = (count * both - np.outer(x, y)) ** 2 * count
        square = np.divide(excess, spread, out=np.zeros_like(both), where=spread > 0)
        largest = np.maximum(largest, square)
    tests = max(1, actions * size * size)
    limit = NormalDist().inv_cdf(1 - _ACCIDENT / tests / 2) ** 2
    found: NDArray[np.bool_] = (
        np.maximum(largest.max(axis=0), largest.max(axis=1)) > limit
    )
    return found


def hidden(
    pairs: NDArray[np.intp], led: NDArray[np.intp], tick: NDArray[np.intp]
) -> bool:
    """Return whether places look alike that are not; see `told_before`."""
    of_open, of_all = told_before(pairs, led, tick)
    return of_open > HIDDEN and of_all > SELDOM


def told_before(
    pairs: NDArray[np.intp], led: NDArray[np.intp], tick: NDArray[np.intp]
) -> tuple[float, float]:
    """Return what the move before tells, as a share of what is left open, and of all.

    The first is about 0 where chance alone decides what a place and an action lead to,
    1 where the move before tells all of it. The second is the share of all moves whose
    outcome it tells, and nothing else does. The first is Goodman and Kruskal's tau of
    the move before and the place that followed, within each pair, less what it is
    expected to be by accident.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        tick: ``(m,)``, ascending, the tick after it.
    """
    then = np.flatnonzero(np.diff(tick, prepend=-1) == 1)
    then = then[then > 0]
    _, pair = np.unique(pairs[then], return_inverse=True)
    many = 1 + int(max(pairs.max(), led.max()))
    of, first, case, size = np.unique(
        pairs[then - 1] * many + pairs[then],
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    if not len(of):
        return 0.0, 0.0

    def purity(group: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return for each group the sum of the squares of how often each followed."""
        cells, times = np.unique(group * many + led[then], return_counts=True)
        sums: NDArray[np.float64] = np.zeros(int(group.max()) + 1)
        np.add.at(sums, cells // many, times.astype(np.float64) ** 2)
        return sums

    whole = np.bincount(pair)[pair[first]].astype(np.float64)
    alike = purity(pair)[pair[first]]
    other = (whole - size) * (whole**2 - alike) / np.maximum(whole - 1, 1)
    expected = float(((size * alike + other) / whole**2).sum())
    found = float((purity(case) / size).sum())
    told, left = found - expected, len(then) - expected
    return (told / left, told / len(then)) if left > 0 else (0.0, 0.0)


def told_by(
    pairs: NDArray[np.intp], led: NDArray[np.intp], readings: NDArray[np.bool_]
) -> int | None:
    """Return the sensor that tells most of what a place and an action leave open.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        readings: ``(m, C)``, what each sensor read before it.

    Returns:
        The first of those that tell most, by Goodman and Kruskal's tau, less what is
        expected by accident; None if that is less than `HIDDEN` of what is open.
    """
    many = 1 + int(max(pairs.max(), led.max()))
    cells, cell = np.unique(pairs * many + led, return_inverse=True)
    _, of, outcomes = np.unique(cells // many, return_inverse=True, return_counts=True)
    several = outcomes[of] > 1
    moves = np.flatnonzero(several[cell])
    if not moves.size:
        return None
    moves = moves[np.argsort(cell[moves], kind="stable")]
    begins = np.flatnonzero(np.diff(cell[moves], prepend=-1))
    first = np.flatnonzero(np.diff(of[several], prepend=-1))
    whole = np.diff(begins, append=len(moves))[:, None].astype(np.float64)
    on = np.add.reduceat(readings[moves], begins, axis=0, dtype=np.float64)

    def parts(
        times: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return for each pair how many moves, and the sum of squares by outcome."""
        return np.add.reduceat(times, first), np.add.reduceat(times**2, first)

    size, alike = parts(whole)
    found = np.zeros((len(first), readings.shape[1]))
    parted = np.ones_like(found, np.bool_)
    for part in on, whole - on:
        of_part, squares = parts(part)
        found += squares / np.maximum(of_part, 1)
        parted &= of_part > 0
    accident = (alike + (size**2 - alike) / np.maximum(size - 1, 1)) / size
    gain = (found - np.where(parted, accident, alike / size)).sum(axis=0)
    best = int(gain.argmax())
    left = float((size - accident).sum())
    return best if gain[best] > HIDDEN * left else None


def expected_now(
    pairs: NDArray[np.intp],
    led: NDArray[np.intp],
    tick: NDArray[np.intp],
    begun: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which moves tell what follows in this trajectory: ``(m,)``.

    What is hidden may last as long as a trajectory. Then an action leads to what it led
    to here before, and to try it again and again is to go in circles. If that tells
    more than `HIDDEN` of what is left open, of each pair that was met in this
    trajectory only the last time counts, and those that followed the same outcome.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        tick: ``(m,)``, ascending, the tick after it.
        begun: By tick, whether a trajectory began there.
    """
    since = np.maximum.accumulate(np.where(begun, np.arange(len(begun)), -1))
    of = since[tick]
    order = np.argsort(pairs, kind="stable")  # of each in the order of its ticks
    again = (np.diff(pairs[order]) == 0) & (np.diff(of[order]) == 0)
    later, earlier = order[1:][again], order[:-1][again]
    many = 1 + int(max(pairs.max(), led.max()))
    _, cell, times = np.unique(
        pairs * many + led, return_inverse=True, return_counts=True
    )
    by_accident = (times[cell] / np.bincount(pairs)[pairs])[earlier].sum()
    told = (led[later] == led[earlier]).sum() - by_accident
    kept = np.ones(len(pairs), np.bool_)
    if told <= HIDDEN * (len(later) - by_accident):
        return kept
    last = np.full(many, -1)  # outcome by pair, in this trajectory
    now = np.flatnonzero(of == since[-1])
    last[pairs[now]] = led[now]
    before = np.full(len(pairs), -1)
    before[later] = led[earlier]
    kept &= (last[pairs] < 0) | (before == last[pairs])
    newest = np.unique(pairs[now][::-1], return_index=True)[1]
    kept[now[::-1][newest]] = True
    return kept
