"""The compiled loop of a worker: one wave through all of its cells."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.compiled import njit

Ints = NDArray[np.int32]


class Net(NamedTuple):
    """The out-edges of some cells' literals, which are numbered from `first` up."""

    first: int
    """The first of the literals."""
    starts: NDArray[np.int64]
    """``(n + 1,)``, where the edges of each literal start in `targets`."""
    targets: Ints
    """``(e,)``, literals of any cell; ascending for each source."""
    owners: Ints
    """``(e,)``, the worker that hosts each target's cell."""


class Pulses(NamedTuple):
    """Some pulses of one wave, as arrays with one entry per pulse."""

    sources: Ints
    targets: Ints
    hops: Ints
    credit: Ints


class Fired(NamedTuple):
    """The literals that pulses made fire, and the credit that ended in this worker."""

    literals: Ints
    """``(f,)``, the literals that fired, by hops."""
    given: Ints
    """``(f,)``, for each the share ``2^-e`` that it fired with."""
    back: NDArray[np.int64]
    """``(b,)``, how many shares ended here, by exponent; see `carried`."""
    least: int
    """The exponent that `back` begins with."""
    pulses: int
    """Pulses sent along edges, to whomever."""


@njit()
def spread(net: Net, reached: Ints, targets: Ints, hops: Ints, credit: Ints) -> Fired:
    """Pass pulses on among the cells, until all that remain are for others.

    What `neurosnap.protocol.cell.Cell` does for one cell, level by level: a literal
    fires on the pulse with the fewest hops of those that came, and of these on the
    first.

    Args:
        net: The edges.
        reached: ``(n,)``, the hops at which each literal fired in this wave, -1 if it
            has not; updated.
        targets: ``(k,)``, at least one, the literals pulsed, all of these cells.
        hops: ``(k,)``, ascending.
        credit: ``(k,)``, exponents.

    Returns:
        What fired. O(n + k + the edges of what fires) time.
    """
    least = credit.min()
    back = np.zeros(64, np.int64)
    literals = np.empty(reached.shape[0], np.int32)
    given = np.empty(reached.shape[0], np.int32)
    head = tail = taken = pulses = 0
    while head < tail or taken < targets.shape[0]:
        level = hops[taken] if head == tail else reached[literals[head] - net.first]
        while taken < targets.shape[0] and hops[taken] == level:
            place = targets[taken] - net.first
            if reached[place] < 0:
                reached[place] = level
                literals[tail] = targets[taken]
                given[tail] = credit[taken]
                tail += 1
            else:
                if credit[taken] - least >= back.shape[0]:
                    back = _grown(back, credit[taken] - least)
                back[credit[taken] - least] += 1
            taken += 1
        end = tail
        while head < end:
            place = literals[head] - net.first
            start, stop = net.starts[place], net.starts[place + 1]
            larger, exponent = split(given[head], stop - start + 1)
            # No share of it is smaller, so the pulses are counted without a question.
            if exponent - least >= back.shape[0]:
                back = _grown(back, exponent - least)
            back[exponent - (larger > 0) - least] += 1
            for edge in range(start, stop):
                target = net.targets[edge]
                share = exponent - (edge - start + 1 < larger)
                place = target - net.first
                if 0 <= place < reached.shape[0]:
                    if reached[place] < 0:
                        reached[place] = level + 1
                        literals[tail] = target
                        given[tail] = share
                        tail += 1
                    else:
                        back[share - least] += 1
            pulses += stop - start
            head += 1
    return Fired(literals[:tail], given[:tail], back, least, pulses)


@njit()
def outgoing(net: Net, reached: Ints, fired: Fired, to: int) -> Pulses:
    """Return the pulses of what fired to the cells that `to` hosts, by hops."""
    count = 0
    for literal in fired.literals:
        place = literal - net.first
        for edge in range(net.starts[place], net.starts[place + 1]):
            count += net.owners[edge] == to
    out = np.empty((4, count), np.int32)
    count = 0
    for number in range(fired.literals.shape[0]):
        literal = fired.literals[number]
        place = literal - net.first
        start, stop = net.starts[place], net.starts[place + 1]
        larger, exponent = split(fired.given[number], stop - start + 1)
        for edge in range(start, stop):
            if net.owners[edge] == to:
                out[0, count] = literal
                out[1, count] = net.targets[edge]
                out[2, count] = reached[place] + 1
                out[3, count] = exponent - (edge - start + 1 < larger)
                count += 1
    return Pulses(out[0], out[1], out[2], out[3])


@njit()
def split(credit: int, parts: int) -> tuple[int, int]:
    """Return what `split_evenly` of `neurosnap.protocol.cell_and_worker_base` does.

    Returns:
        How many of the shares are larger, and the exponent of the smaller ones; that of
        the larger, which come first, is one less.
    """
    depth = 0
    while 1 << depth < parts:
        depth += 1
    return (1 << depth) - parts, credit + depth


@njit()
def _grown(counts: NDArray[np.int64], place: int) -> NDArray[np.int64]:
    """Return counts with room for `place`.

    Whether there is any is asked before: to hand an array to and fro for each pulse
    would take three times as long as the wave.
    """
    more = np.zeros(2 * place, np.int64)
    more[: counts.shape[0]] = counts
    return more


def carried(back: NDArray[np.int64], least: int) -> tuple[int, ...]:
    """Add shares up: two of ``2^-e`` make one of ``2^-(e - 1)``.

    Args:
        back: How many there are of each exponent, from `least` on; overwritten.
        least: At least 0.

    Returns:
        The exponents left, ascending, each once; only 0 comes again, where the shares
        are more than the one that a wave starts with: then they are wrong, and what is
        said here is more than one too.
    """
    _carry(back)
    whole = int(back[0])
    larger: list[int] = []
    for place in range(whole.bit_length() - 1, -1, -1):
        if whole >> place & 1:
            larger += [least - place] if place <= least else [0, 0]
    return (*larger, *(least + 1 + np.flatnonzero(back[1:])).tolist())


@njit()
def _carry(counts: NDArray[np.int64]) -> None:
    for place in range(counts.shape[0] - 1, 0, -1):
        counts[place - 1] += counts[place] >> 1
        counts[place] &= 1


def warm() -> None:
    """Compile the loops, or load them from the cache, before the first wave."""
    none = np.empty(0, np.int32)
    zero = np.zeros(1, np.int32)
    reached = np.full(1, -1, np.int32)
    net = Net(0, np.zeros(2, np.int64), none, none)
    fired = spread(net, reached, zero, zero, zero)
    outgoing(net, reached, fired, 0)
    carried(fired.back, fired.least)
