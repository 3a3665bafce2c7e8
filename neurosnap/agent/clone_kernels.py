"""The loops over past readings by which places that look alike are told apart.

A hidden state is a look and one of so many *clones* of it. A *kind* of step is a look,
an action, and the look after it; steps from the same look by the same action are of the
same *group*.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.compiled import njit

Bits = NDArray[np.bool_]
Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]


@njit()
def expect(
    kinds: Numbers, leads: Floats, ahead: Floats, counts: Floats, least: float
) -> float:
    """Add up how often each clone is expected to have led to each (Baum-Welch).

    Args:
        kinds: ``(m,)``: the kind of each step; -1: a trajectory ends there.
        leads: ``(kinds, C, C)``: with what chance a clone leads to one after it.
        ahead: ``(m + 1, C)``: overwritten.
        counts: ``(kinds, C, C)``: overwritten.
        least: What each count begins with.

    Returns:
        The logarithm of the readings' likelihood. O(m C²) time.
    """
    steps, clones = ahead.shape[0] - 1, ahead.shape[1]
    told = 0.0
    ahead[0] = 1.0 / clones
    for t in range(steps):
        ahead[t + 1] = 0.0
        if kinds[t] < 0:
            ahead[t + 1] = 1.0 / clones
            continue
        mine = leads[kinds[t]]
        whole = 0.0
        for i in range(clones):
            share = ahead[t, i]
            if share > 0.0:
                for j in range(clones):
                    ahead[t + 1, j] += share * mine[i, j]
        for j in range(clones):
            whole += ahead[t + 1, j]
        told += np.log(whole)
        for j in range(clones):
            ahead[t + 1, j] /= whole
    counts[:] = least
    behind, before = np.ones(clones), np.ones(clones)
    for t in range(steps - 1, -1, -1):
        if kinds[t] < 0:
            behind[:] = 1.0
            continue
        mine, count = leads[kinds[t]], counts[kinds[t]]
        whole, largest = 0.0, 0.0
        for i in range(clones):
            share = 0.0
            for j in range(clones):
                share += mine[i, j] * behind[j]
            before[i] = share
            whole += ahead[t, i] * share
            largest = max(largest, share)
        for i in range(clones):
            share = ahead[t, i] / whole
            if share > 0.0:
                for j in range(clones):
                    count[i, j] += share * mine[i, j] * behind[j]
        for i in range(clones):
            behind[i] = before[i] / largest
    return told


@njit()
def share_out(counts: Floats, groups: Numbers, leads: Floats) -> None:
    """Make chances of counts: those of one clone and one group add up to 1.

    Both are ``(kinds, C, C)``; `groups` says of which group each kind is, ``(kinds,)``.
    """
    clones = counts.shape[1]
    whole = np.zeros((groups.max() + 1, clones))
    for kind in range(len(groups)):
        for i in range(clones):
            for j in range(clones):
                whole[groups[kind], i] += counts[kind, i, j]
    for kind in range(len(groups)):
        for i in range(clones):
            for j in range(clones):
                leads[kind, i, j] = counts[kind, i, j] / whole[groups[kind], i]


@njit()
def likeliest(kinds: Numbers, leads: Floats) -> Numbers:
    """Return the likeliest way through the clones: ``(m + 1,)`` (Viterbi).

    Arguments are as for `expect`. O(m C²) time.
    """
    steps, clones = len(kinds), leads.shape[1]
    way = np.zeros((steps + 1, clones), np.int64)
    best, after = np.zeros(clones), np.zeros(clones)
    for t in range(steps):
        for j in range(clones):
            after[j] = -np.inf
            for i in range(clones):
                told = best[i]
                if kinds[t] >= 0:
                    told += np.log(leads[kinds[t], i, j])
                if told > after[j]:
                    after[j], way[t + 1, j] = told, i
        best[:] = after - after.max()
    found = np.zeros(steps + 1, np.int64)
    found[steps] = best.argmax()
    for t in range(steps, 0, -1):
        found[t - 1] = way[t, found[t]]
    return found


@njit()
def track(leads: Numbers, actions: Numbers, fits: Bits, possible: Bits) -> Numbers:
    """Follow which clones may be on.

    Args:
        leads: ``(actions, K)``: to which clone each leads; -1: it is not known.
        actions: ``(m,)``: the action that led to each tick; -1: none that is known.
        fits: ``(m, K)``: whether what was read goes with a clone.
        possible: ``(m + 1, K)``: first which may have been on before; the others are
            overwritten.

    Returns:
        ``(m,)``: 0; or 1 where none of those fits that it could have led to: there all
        that fit are possible. O(m K) time.
    """
    lost = np.zeros(len(actions), np.int64)
    for t in range(len(actions)):
        anywhere, none = actions[t] < 0, True
        possible[t + 1] = False
        if not anywhere:
            for j in range(leads.shape[1]):
                if possible[t, j]:
                    after = leads[actions[t], j]
                    if after < 0:
                        anywhere = True
                        break
                    possible[t + 1, after] = True
        for k in range(leads.shape[1]):
            possible[t + 1, k] = fits[t, k] and (anywhere or possible[t + 1, k])
            none = none and not possible[t + 1, k]
        if none:
            possible[t + 1] = fits[t]
            lost[t] = not anywhere
    return lost


def warm() -> None:
    """Compile the loops, or load them from the cache."""
    kinds, chances = np.zeros(1, np.int64), np.ones((1, 1, 1))
    expect(kinds, chances, np.ones((2, 1)), np.ones((1, 1, 1)), 0.0)
    share_out(chances, kinds, chances)
    likeliest(kinds, chances)
    on = np.ones((2, 1), np.bool_)
    track(np.zeros((1, 1), np.int64), kinds, on[:1], on)
