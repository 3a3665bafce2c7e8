"""An excitation-driven agent in a world of places, as one compiled loop.

Step by step it is `neurosnap.agent.agent.Agent` with `Excited` in a world with the
sensors `better` and `worse`; here nothing is turned into Python objects on the way, so
that millions of steps can be looked at.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.excited import choose
from neurosnap.poc.learning.update_kernels import (
    learn_counts,
    learn_discounted,
    project,
)
from neurosnap.poc.order.kernels import spread
from neurosnap.system.compiled import njit

_ONE = np.uint64(1)


@njit(nogil=True)
def drive(
    moves: NDArray[np.intp],
    fields: NDArray[np.uint8],
    distances: NDArray[np.float64],
    start: int,
    threshold: float,
    decay: float,
    explore: float,
    draws: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Let an agent that knows nothing loose, and see how far from the target it is.

    The sensors are those of `Body.full`: the fields', `better`, `worse`, the actions,
    and every action in the context of every field and its complement.

    Args:
        moves: ``(actions, places)``; where an action leads.
        fields: ``(sensors, places)``, 0 or 1.
        distances: ``(places,)``, to the target.
        start: The first place.
        threshold: The learning threshold of every pair.
        decay: Of a discounted snapshot; negative: an empirical one.
        explore: The share of random actions.
        draws: ``(steps + 1, WIDTH)``: `RandomNumbers.table`; row `t` decides tick `t`.

    Returns:
        For each step ``(steps,)``: the distance to the target at which the observation
        was made, the action then decided on, and the reason.

    Cost:
        O(N²/2) a step for ``N = sensors + 2 + actions (1 + 2 sensors)``.
    """
    actions, own = moves.shape[0], fields.shape[0]
    steps = draws.shape[0] - 1
    better, worse, first = own, own + 1, own + 2
    contextual = first + actions
    count = contextual + actions * 2 * own
    pairs = count * (count - 1) // 2
    width = (2 * count + 63) // 64
    limit = np.full(1, threshold)
    # Only one of the two kinds of weights is used.
    empirical = decay < 0
    counts = np.zeros(pairs if empirical else 0, np.uint32)
    count_of = np.zeros(count, np.uint32)
    shares = np.full(0 if empirical else pairs, 0.25)
    share_of = np.full(count, 0.5)
    codes = np.zeros(pairs, np.uint8)
    rows = np.zeros((2 * count, width), np.uint64)
    bits = np.zeros(count, np.uint8)
    state = np.zeros(2 * count, np.bool_)
    reached = np.empty(width, np.uint64)
    possible = np.ones(actions, np.bool_)  # each is pure
    seeks = np.empty(actions, np.bool_)
    keeps = np.empty(actions, np.bool_)
    distance = np.empty(steps, np.float64)
    decided = np.empty(steps, np.int64)
    reason = np.empty(steps, np.int64)
    place = before = start
    action = -1
    for step in range(steps):
        bits[:] = 0
        bits[:own] = fields[:, place]
        bits[better] = distances[place] < distances[before]
        bits[worse] = distances[place] > distances[before]
        if action >= 0:
            bits[first + action] = 1
            base = contextual + action * 2 * own
            for literal in range(2 * own):
                bits[base + literal] = state[literal]
        if empirical:
            learn_counts(bits, counts, count_of, step + 1, limit, codes, rows)
        else:
            learn_discounted(bits, shares, share_of, decay, limit, codes, rows)
        project(bits, rows, state)
        for option in range(actions):
            reached[:] = 0
            _switch_on(reached, 2 * (first + option))
            base = contextual + option * 2 * own
            for literal in range(2 * own):
                if state[literal]:
                    _switch_on(reached, 2 * (base + literal))
            spread(rows, reached)
            seeks[option] = _is_on(reached, 2 * better) and not _is_on(
                reached, 2 * better + 1
            )
            keeps[option] = _is_on(reached, 2 * worse + 1) and not _is_on(
                reached, 2 * worse
            )
        action, why = choose(possible, seeks, keeps, explore, draws[step + 1])
        distance[step] = distances[place]
        decided[step] = action
        reason[step] = why
        before, place = place, moves[action, place]
    return distance, decided, reason


@njit()
def _switch_on(literals: NDArray[np.uint64], literal: int) -> None:
    literals[literal >> 6] |= _ONE << np.uint64(literal & 63)


@njit()
def _is_on(literals: NDArray[np.uint64], literal: int) -> bool:
    return bool((literals[literal >> 6] >> np.uint64(literal & 63)) & _ONE)
