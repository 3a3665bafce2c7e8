"""The coherent states of an order as bit masks, for `Cubing` and `ConvexSet`.

Sets of literals are masks (`neurosnap.poc.order.literal_sets`). A *closed* mask holds
everything above its literals and all ubiquitous literals, and is coherent; closed masks
and non-empty convex sets are the same thing ([GK] lemma:supporting halfspace), and a
vertex is a closed mask that decides every sensor.

Vertices and cubes are counted without listing them. What is left to decide after some
decisions depends only on which elements are undecided, so a count is a sum over both
sides of one element, remembered by the set of the undecided; and where these fall into
parts that all cross each other, the dual is a product ([GK] eqn:direct sum) and counts
multiply. A cube of dimension ``d`` weighs ``t**d``: those on either side of an element,
and ``t`` for each cube of the dual of what crosses it. Weights multiply over products,
and with ``t`` a power of two beyond any count the digits of the sum are the face
vector: one number instead of a polynomial.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.literal_sets import (
    Literals,
    as_literals,
    from_mask,
    members,
    positive,
    starred,
    to_mask,
)
from neurosnap.poc.order.pocset import PocSet

LISTABLE = 1_000_000
"""The most vertices that are listed without being asked to list more."""


class Dual:
    """The dual of a poc set, on bit masks: lists its vertices and steps between them.

    Attributes:
        poc: As given.
        total: The number of literals.
        heads: The representatives of the proper elements.
        up: What is above each literal.
        down: What is below each literal.
        counter: What counts without listing.
    """

    def __init__(self, poc: PocSet) -> None:
        order = poc.order
        heads: list[int] = poc.heads.tolist()
        self.poc = poc
        self.total = len(order)
        self.even = positive(self.total)
        self.up = [to_mask(row) for row in order]
        self.down = [to_mask(column) for column in order.T]
        self.heads = sum(1 << a for a in heads)
        decided = {a: self.heads & (self.up[a] | self.star(self.up[a])) for a in heads}
        self.counter = Counter(decided)
        self._cross = {a: self.heads & ~(decided[a] | decided[a ^ 1]) for a in heads}
        self._ubiquitous = to_mask(poc.ubiquitous)

    def star(self, mask: int) -> int:
        """Return the complements of a set."""
        return starred(mask, self.even)

    def array(self, mask: int) -> NDArray[np.bool_]:
        """Return a set as ``(2N,)`` bool."""
        return from_mask(mask, self.total)

    def closed(self, literals: NDArray[np.bool_]) -> int | None:
        """Return the literals that all vertices with some literals share; else None."""
        closed = self._ubiquitous
        for a in np.flatnonzero(literals).tolist():
            closed |= self.up[a]
        return None if closed & self.star(closed) else closed

    def free(self, closed: int) -> int:
        """Return the representatives that a closed set leaves undecided."""
        return self.heads & ~(closed | self.star(closed))

    def walk(self, closed: int) -> Iterator[int]:
        """Yield the vertices above a closed set, none twice.

        An undecided proper literal may be added to any closed set: were it below the
        complement of one in the set, its own complement would be there too.
        """
        pending = [closed]
        while pending:
            closed = pending.pop()
            free = self.free(closed)
            if not free:
                yield closed
                continue
            a = (free & -free).bit_length() - 1
            pending.append(closed | self.up[a ^ 1])
            pending.append(closed | self.up[a])

    def flip(self, vertex: int, a: int) -> int:
        """Return a set with `a`, and all equal to it, replaced by complements."""
        same = self.up[a] & self.down[a]
        return vertex & ~same | self.star(same)

    def minimal(self, vertex: int) -> int:
        """Return the representatives of the minimal proper elements of a vertex."""
        found = 0
        for a in members(vertex & self.heads):
            if not vertex & self.down[a] & ~self.up[a]:
                found |= 1 << a
        return found

    def crossing(self, among: int) -> Iterator[tuple[int, ...]]:
        """Yield the sets of pairwise crossing representatives, the empty one first."""
        pending: list[tuple[tuple[int, ...], int]] = [((), among)]
        while pending:
            chosen, rest = pending.pop()
            yield chosen
            longer = []
            for a in members(rest):
                rest ^= 1 << a
                longer.append(((*chosen, a), rest & self._cross[a]))
            pending += reversed(longer)

    def vertex(self, name: str, given: Literals) -> int:
        """Return a vertex as a mask.

        Args:
            name: What to call it in an error.
            given: ``(2N,)`` bool or literals.

        Raises:
            ShapeError: It is an array of another shape.
            InvalidValueError: It is no complete coherent *-selection.
        """
        chosen = as_literals(name, given, self.total)
        odd = np.flatnonzero(chosen[::2] == chosen[1::2])
        if odd.size:
            sensor = self.poc.name(2 * int(odd[0]))
            if chosen[2 * int(odd[0])]:
                rule = "must be a *-selection, without a literal and its complement"
                raise InvalidValueError(name, rule, f"{sensor} and {sensor}*")
            rule = "must be complete, with one literal of every sensor"
            raise InvalidValueError(name, rule, f"neither {sensor} nor {sensor}*")
        mask = to_mask(chosen)
        if any(self.up[a] & ~mask for a in members(mask)):
            rule = "must be coherent, without a literal below another's complement"
            raise InvalidValueError(name, rule, self.clash(chosen))
        return mask

    def clash(self, literals: NDArray[np.bool_]) -> str:
        """Return what keeps a set from being coherent, for an error."""
        pair = self.poc.clash(literals)
        if pair is None:
            return "nothing"
        a, b = pair
        other = b[:-1] if b.endswith("*") else f"{b}*"
        return f"{a} and {other}, although {a} <= {b}"


class Counter:
    """Counts the vertices and faces of an order's dual, without listing them.

    Args:
        decided: For each representative of a proper element, the representatives
            whose elements it decides: those above it and their complements.

    Examples:
        >>> Counter({0: 0b11, 1: 0b11}).vertices(0b11)
        2
    """

    def __init__(self, decided: dict[int, int]) -> None:
        self._decided = decided
        self._even = positive(max(decided, default=0) + 1)
        self._nested = {a: mask | decided[a ^ 1] for a, mask in decided.items()}
        self._counts: dict[int, int] = {0: 1}

    def vertices(self, free: int) -> int:
        """Return how many vertices complete a set that leaves `free` undecided."""
        self._weigh(free, 0, self._counts)
        return self._counts[free]

    def faces(self, free: int) -> tuple[int, ...]:
        """Return how many cubes of each dimension the dual of `free` has."""
        # A dual of n elements has at most 3**n < 2**(2n) cubes.
        digits = max(free.bit_count(), 1)
        sums: dict[int, int] = {0: 1}
        self._weigh(free, 1 << digits, sums)
        total, vector = sums[free], []
        while total:
            vector.append(total & (1 << digits) - 1)
            total >>= digits
        return tuple(vector)

    def _weigh(self, free: int, t: int, sums: dict[int, int]) -> None:
        """Enter the weight of `free`, and of all it takes.

        An explicit stack: a chain of decisions is as long as there are elements.
        """
        pending = [free]
        while pending:
            here = pending[-1]
            if here in sums:
                pending.pop()
                continue
            parts = list(self._parts(here))
            if len(parts) > 1:
                missing = [part for part in parts if part not in sums]
                if not missing:
                    sums[here] = math.prod(sums[part] for part in parts)
            else:
                missing = self._branch(here, t, sums)
            pending += missing

    def _branch(self, part: int, t: int, sums: dict[int, int]) -> list[int]:
        """Enter the weight of a part by its pivot, or return what that still takes."""
        a = self._pivot(part)
        one = part & ~self._decided[a]
        other = part & ~self._decided[a ^ 1]
        across = part & ~self._nested[a] if t else 0
        missing = [rest for rest in (one, other, across) if rest not in sums]
        if not missing:
            sums[part] = sums[one] + sums[other] + t * sums[across]
        return missing

    def _pivot(self, part: int) -> int:
        """Return the element whose lesser side decides most, so that halves result."""

        def worth(a: int) -> tuple[int, int]:
            one = (part & self._decided[a]).bit_count()
            other = (part & self._decided[a ^ 1]).bit_count()
            return min(one, other), max(one, other)

        return max(members(part & self._even), key=worth)

    def _parts(self, free: int) -> Iterator[int]:
        """Yield the parts of a set between which everything crosses."""
        while free:
            part = ring = free & -free
            while ring:
                lowest = ring & -ring
                nested = self._nested[lowest.bit_length() - 1]
                fresh = nested & free & ~part
                part |= nested & free
                ring = (ring ^ lowest) | fresh & self._even
            yield part
            free &= ~part
