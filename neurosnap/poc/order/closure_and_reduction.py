"""The order that implications generate: transitive closure, Hasse reduction, heights.

All of it is worked out from nothing every time, by one walk over the literals and one
sweep back, on packed rows: a literal looks only at what nothing nearer has brought in
yet. What is looked at so is a word in 64 edges, and an edge of the result; to find what
a change of the relation leaves as it was would take as long, and a state to keep right.

The relation is closed under contraposition: with ``a -> b`` it has ``b* -> a*``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.literal_set_kernels import lowest
from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

_ONE = np.uint64(1)


class Order(NamedTuple):
    """The read-only order of a relation on ``n`` literals ([GK] "poc graph")."""

    closed: Words
    """``(n, w)``: bit ``b`` of row ``a`` iff ``a <= b``, a path leads there."""
    representative: NDArray[np.int64]
    """``(n,)``: the one of least name in each one's class, those of ``a <= b <= a``."""
    covers: Words
    """``(n, w)``: bit ``b`` of row ``a`` iff both represent, and ``a < b`` with nothing
    in between."""
    heights: NDArray[np.int64]
    """``(n,)``: edges on the longest chain going up."""


def order_of(rows: Words, names: NDArray[np.int64]) -> Order:
    """Return the order of a relation.

    Args:
        rows: ``(n, w)``, edges closed under contraposition.
        names: ``(n,)``, each once: what stands for a class goes by them.

    Cost:
        O(n w) words to read all rows, O(w) for each of the ``c`` covers and at most a
        test for each pair of literals: O((n + c) w + n²) time. Orders that are learned
        have a few covers a literal. At worst half of all literals are below the other
        half, ``c = n²/4``.
    """
    order = Order(
        closed=np.empty_like(rows),
        representative=np.empty(len(rows), np.int64),
        covers=np.zeros_like(rows),
        heights=np.empty(len(rows), np.int64),
    )
    _close_and_reduce(rows, names, *order)
    for array in order:
        array.flags.writeable = False
    return order


@njit()
def _close_and_reduce(
    rows: Words,
    names: NDArray[np.int64],
    closed: Words,
    representative: NDArray[np.int64],
    covers: Words,
    heights: NDArray[np.int64],
) -> None:
    """Fill an `Order`: closure and Hasse (transitive) reduction; `covers` comes in 0.

    Class by class, from the top. The edges that leave a class are followed in the
    order of their nearness, and only to what those before do not lead to: so each of
    them is a cover, and the closure grows by whole rows.
    """
    width = rows.shape[1]
    sequence, starts = _classes(rows)
    above = np.empty(width, np.uint64)
    beyond = np.empty(width, np.uint64)
    for number in range(starts.shape[0] - 1):
        members = sequence[starts[number] : starts[number + 1]]
        head = members[names[members].argmin()]
        above[:] = 0
        beyond[:] = 0
        for a in members:
            above[a >> 6] |= _ONE << np.uint64(a & 63)
            for k in range(width):
                beyond[k] |= rows[a, k]
        pending = _strip(beyond, above)
        height = 0
        # Downwards from the class, whatever lies between comes before what it leads to.
        place = starts[number]
        while pending:
            place -= 1
            b = sequence[place]
            if (beyond[b >> 6] >> np.uint64(b & 63)) & _ONE:
                b = representative[b]
                covers[head, b >> 6] |= _ONE << np.uint64(b & 63)
                height = max(height, heights[b] + 1)
                for k in range(width):
                    above[k] |= closed[b, k]
                pending = _strip(beyond, closed[b])
        for a in members:
            representative[a] = head
            heights[a] = height
            closed[a] = above


@njit()
def wired(rows: Words, representative: NDArray[np.int64]) -> Words:
    """Return the edges between representatives, and those inside the classes.

    An edge ``a -> b`` becomes one between their representatives; every other member of
    a class has an edge from its representative and one back.

    Args:
        rows: ``(n, w)``, the out-edges of every literal.
        representative: ``(n,)``, of each literal's class.

    Returns:
        ``(n, w)``, no bit on the diagonal. O(n w) time, and O(1) for each edge from a
        class to a literal that does not represent its own.
    """
    total, width = rows.shape
    heads = np.zeros(width, np.uint64)
    for a in range(total):
        if representative[a] == a:
            heads[a >> 6] |= _ONE << np.uint64(a & 63)
    wires = np.zeros((total, width), np.uint64)
    for a in range(total):
        head = representative[a]
        for k in range(width):
            wires[head, k] |= rows[a, k]
    for head in range(total):
        if representative[head] != head:
            continue
        for k in range(width):
            others = wires[head, k] & ~heads[k]
            wires[head, k] ^= others
            while others:
                b = representative[64 * k + lowest(others)]
                wires[head, b >> 6] |= _ONE << np.uint64(b & 63)
                others &= others - _ONE
    for a in range(total):
        wires[a, a >> 6] &= ~(_ONE << np.uint64(a & 63))
    for a in range(total):
        head = representative[a]
        if head != a:
            wires[head, a >> 6] |= _ONE << np.uint64(a & 63)
            wires[a, head >> 6] |= _ONE << np.uint64(head & 63)
    return wires


@njit()
def _strip(words: Words, known: Words) -> np.uint64:
    """Take `known` from a set; return 0 iff nothing is left."""
    left = np.uint64(0)
    for k in range(words.shape[0]):
        words[k] &= ~known[k]
        left |= words[k]
    return left


@njit()
def _classes(rows: Words) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the literals class by class, each after all that is above it.

    Kosaraju's way: taken in the order in which a walk against the edges leaves them,
    last first, what is newly reached along the edges is a class. Complements turn the
    edges around: such a walk is one along the edges, complemented.

    Returns:
        The literals, ``(n,)``, and where each class starts, with ``n`` last.
    """
    total, width = rows.shape
    left = _left(rows)
    fresh = ~np.zeros(width, np.uint64)  # bits beyond the last literal are in no row
    sequence = np.empty(total, np.int64)
    starts = np.empty(total + 1, np.int64)
    count = filled = 0
    for place in range(total - 1, -1, -1):
        root = left[place] ^ 1
        if not (fresh[root >> 6] >> np.uint64(root & 63)) & _ONE:
            continue
        fresh[root >> 6] ^= _ONE << np.uint64(root & 63)
        starts[count] = following = filled
        sequence[filled] = root
        count += 1
        filled += 1
        while following < filled:
            a = sequence[following]
            following += 1
            for k in range(width):
                found = rows[a, k] & fresh[k]
                fresh[k] ^= found
                while found:
                    sequence[filled] = 64 * k + lowest(found)
                    filled += 1
                    found &= found - _ONE
    starts[count] = total
    return sequence, starts[: count + 1]


@njit()
def _left(rows: Words) -> NDArray[np.int64]:
    """Return the literals in the order in which a depth-first walk leaves them."""
    total, width = rows.shape
    fresh = ~np.zeros(width, np.uint64)  # bits beyond the last literal are in no row
    words = np.zeros(total, np.int64)  # a literal's words that have nothing fresh
    path = np.empty(total, np.int64)
    left = np.empty(total, np.int64)
    count = 0
    for root in range(total):
        if not (fresh[root >> 6] >> np.uint64(root & 63)) & _ONE:
            continue
        fresh[root >> 6] ^= _ONE << np.uint64(root & 63)
        path[0] = root
        length = 1
        while length:
            a = path[length - 1]
            k = words[a]
            while k < width and not rows[a, k] & fresh[k]:
                k += 1
            words[a] = k
            if k == width:
                left[count] = a
                count += 1
                length -= 1
                continue
            literal = 64 * k + lowest(rows[a, k] & fresh[k])
            fresh[k] ^= _ONE << np.uint64(literal & 63)
            path[length] = literal
            length += 1
    return left
