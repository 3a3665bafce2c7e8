"""Which sensors of an observation contradict each other, and by which implications.

Sets are packed as in `neurosnap.poc.order.literals`. A conflict graph has a vertex for
each literal that clashes, in ascending order; its rows are packed the same way, a bit
for each vertex.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.kernels import lowest
from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit

Ints = NDArray[np.int64]
_ONE = np.uint64(1)


@njit()
def conflict_rows(closed: Words, clashing: Ints, denied: Words) -> Words:
    """Return which of the literals that clash are in conflict with each other.

    Args:
        closed: ``(2N, w)``: bit ``b`` of row ``a`` iff ``a <= b``.
        clashing: ``(k,)``, ascending: literals seen that are below one denied.
        denied: ``(w,)``: the complements of what was seen.

    Returns:
        ``(k, ceil(k / 64))``, symmetric; a bit on the diagonal is a literal below its
        own complement. O(k w) time, and O(1) for each bit.
    """
    count, width = clashing.shape[0], denied.shape[0]
    place = np.full(64 * width, -1, np.int64)
    for vertex in range(count):
        place[clashing[vertex] ^ 1] = vertex
    rows = np.zeros((count, (count + 63) // 64), np.uint64)
    for vertex in range(count):
        a = clashing[vertex]
        for k in range(width):
            found = closed[a, k] & denied[k]
            while found:
                other = place[64 * k + lowest(found)]
                rows[vertex, other >> 6] |= _ONE << np.uint64(other & 63)
                found &= found - _ONE
    return rows


@njit()
def labels(rows: Words, alive: NDArray[np.bool_]) -> Ints:
    """Return the connected part of each vertex, named by its first; -1 if not alive.

    Args:
        rows: ``(k, w)``, symmetric.
        alive: ``(k,)``: the vertices there are.

    Returns:
        ``(k,)``. O(k w) time.
    """
    count, width = rows.shape
    part = np.full(count, -1, np.int64)
    fresh = _packed(alive, width)
    queue = np.empty(count, np.int64)
    for root in range(count):
        if not (fresh[root >> 6] >> np.uint64(root & 63)) & _ONE:
            continue
        fresh[root >> 6] ^= _ONE << np.uint64(root & 63)
        queue[0], first, last = root, 0, 1
        while first < last:
            v = queue[first]
            first += 1
            part[v] = root
            for k in range(width):
                found = rows[v, k] & fresh[k]
                fresh[k] ^= found
                while found:
                    queue[last] = 64 * k + lowest(found)
                    last += 1
                    found &= found - _ONE
    return part


@njit()
def greedy(rows: Words, degrees: Ints, alive: NDArray[np.bool_], rank: Ints) -> Ints:
    """Cover all edges by what meets most of those left, again and again.

    Args:
        rows: ``(k, w)``, symmetric, no bit on the diagonal.
        degrees: ``(k,)``, of the vertices alive, among these; changed.
        alive: ``(k,)``; what is taken is no longer.
        rank: ``(k,)``: of two that meet as many, the one of higher rank is taken.

    Returns:
        What was taken, in order. O(k) time for each, and O(1) an edge.
    """
    count = rows.shape[0]
    taken = np.empty(count, np.int64)
    number = 0
    while True:
        best = -1
        for v in range(count):
            if not alive[v] or degrees[v] == 0:
                continue
            more = 1 if best < 0 else degrees[v] - degrees[best]
            if more > 0 or (more == 0 and rank[v] > rank[best]):
                best = v
        if best < 0:
            return taken[:number]
        taken[number] = best
        number += 1
        remove_vertex(rows, degrees, alive, best)


@njit()
def remove_vertex(rows: Words, degrees: Ints, alive: NDArray[np.bool_], v: int) -> None:
    """Remove a vertex and its edges from a graph; see `greedy`."""
    alive[v] = False
    degrees[v] = 0
    for k in range(rows.shape[1]):
        found = rows[v, k]
        while found:
            u = 64 * k + lowest(found)
            found &= found - _ONE
            if alive[u]:
                degrees[u] -= 1


@njit()
def forced(
    rows: Words,
    degrees: Ints,
    alive: NDArray[np.bool_],
    part: Ints,
    most: Ints,
) -> None:
    """Take out what every smallest cover has.

    That is what meets more edges than its connected part needs vertices: without it,
    all its neighbours would have to be in the cover. (A rule of S. Buss, see Downey and
    Fellows, Parameterized Complexity, 1999.)

    Args:
        rows: As in `greedy`, and so are the next two.
        degrees: Changed.
        alive: Changed.
        part: ``(k,)``, of each vertex, as `labels` says.
        most: ``(k,)``: for each part, a number of vertices that suffice; changed.
    """
    changed = True
    while changed:
        changed = False
        for v in range(rows.shape[0]):
            if alive[v] and degrees[v] > most[part[v]]:
                most[part[v]] -= 1
                remove_vertex(rows, degrees, alive, v)
                changed = True


@njit()
def without_spares(
    rows: Words, inside: NDArray[np.bool_], taken: Ints, order: Ints
) -> NDArray[np.bool_]:
    """Return a cover without those of it whose neighbours are all in it.

    Args:
        rows: ``(k, w)``, symmetric.
        inside: ``(k,)``: the vertices to be looked at, taken or not.
        taken: The cover.
        order: ``(k,)``, all vertices: the first are given up first.

    Returns:
        ``(k,)``. O(k w) time.
    """
    count, width = rows.shape
    chosen = np.zeros(count, np.bool_)
    for v in taken:
        chosen[v] = True
    outside = _packed(inside & ~chosen, width)
    for v in order:
        if not chosen[v]:
            continue
        spare = True
        for k in range(width):
            spare &= not rows[v, k] & outside[k]
        if spare:
            chosen[v] = False
            outside[v >> 6] |= _ONE << np.uint64(v & 63)
    return chosen


@njit()
def shortest_chains(
    starts: Ints,
    targets: Ints,
    clashing: Ints,
    seen: NDArray[np.bool_],
    most: int,
    looks: int,
) -> tuple[Ints, Ints, int]:
    """Return a shortest way from each literal that clashes to each that it denies.

    Along any way from something seen to something denied there is a last literal seen
    before the first one denied: between those two lie sensors without a reading.

    Args:
        starts: ``(2N + 1,)``: where in `targets` the covers of each literal begin.
        targets: The covers of all literals, those of each ascending.
        clashing: ``(k,)``: literals seen, ascending.
        seen: ``(2N,)``.
        most: How many to list; then the others are counted where one cover leads there.
        looks: At how many literals to look on the way; then likewise.

    Returns:
        The literals of all ways, one after the other; where each ends in it; and how
        many more there are, at least.
    """
    total = starts.shape[0] - 1
    came = np.empty(total, np.int64)
    walk = np.full(total, -1, np.int64)  # on whose walk each was met last
    queue = np.empty(total, np.int64)
    literals = np.empty(1024, np.int64)
    ends = np.empty(1024, np.int64)
    length = listed = more = 0
    for start in clashing:
        walks = listed < most and looks > 0
        walk[start] = start
        queue[0], first, last = start, 0, 1
        while first < last:
            a = queue[first]
            first += 1
            looks -= 1
            for b in targets[starts[a] : starts[a + 1]]:
                if walk[b] == start or seen[b]:
                    continue
                if not seen[b ^ 1]:
                    if walks:
                        walk[b], came[b] = start, a
                        queue[last] = b
                        last += 1
                    continue
                walk[b], came[b] = start, a
                if start > b ^ 1:
                    continue
                if not walks or listed >= most:
                    more += 1
                    continue
                hops, at = 1, b
                while at != start:
                    at = came[at]
                    hops += 1
                while length + hops > literals.shape[0]:
                    literals = np.append(literals, np.empty_like(literals))
                at = b
                for step in range(hops):
                    literals[length + hops - 1 - step] = at
                    at = came[at]
                length += hops
                if listed == ends.shape[0]:
                    ends = np.append(ends, np.empty_like(ends))
                ends[listed] = length
                listed += 1
    return literals[:length], ends[:listed], more


@njit()
def _packed(chosen: NDArray[np.bool_], width: int) -> Words:
    words = np.zeros(width, np.uint64)
    for v in range(chosen.shape[0]):
        if chosen[v]:
            words[v >> 6] |= _ONE << np.uint64(v & 63)
    return words
