"""The dual on integer bit masks, used by `Cubing` and `ConvexSet`.

Sets of literals are masks (`neurosnap.poc.order.masks`). A *closed* mask holds
everything above its literals and all ubiquitous literals, and is coherent; closed masks
and non-empty convex sets are the same thing ([GK] lemma:supporting halfspace), and a
vertex is a closed mask that decides every sensor.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.counting import Counter, shown_size
from neurosnap.poc.order.literals import Literals, as_literals
from neurosnap.poc.order.masks import from_mask, members, positive, starred, to_mask
from neurosnap.poc.order.pocset import PocSet

LISTABLE = 1_000_000
"""The most vertices that are listed without being asked to list more."""


class Dual:
    """The order of a poc set as masks, and the walks over its vertices.

    Args:
        poc: The poc set.

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
        """Return what all vertices with some literals share; None: there are none."""
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

    def limited(self, closed: int, limit: int | None) -> Iterator[int]:
        """Return `walk`, once it is known to yield at most `limit` vertices.

        Raises:
            InvalidValueError: It would yield more, by count or by estimate; where an
                estimate was too low, only when the limit is passed.
        """
        if limit is None:
            return self.walk(closed)
        size, exact = self.counter.sized(self.free(closed))
        if size > limit:
            rule = f"must have at most {limit} vertices to be listed, or set limit=None"
            raise InvalidValueError("dual", rule, shown_size(size, exact=exact))
        return self.walk(closed) if exact else self._stopped(closed, limit)

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

    def _stopped(self, closed: int, limit: int) -> Iterator[int]:
        """Yield `walk`, and raise where it passes a limit that looked safe."""
        for number, vertex in enumerate(self.walk(closed)):
            if number == limit:
                rule = f"must have at most {limit} vertices to be listed"
                raise InvalidValueError("dual", rule, "more")
            yield vertex
