"""Counts the vertices and cubes of a dual without listing them.

What is left to decide after some decisions depends only on which elements are
undecided, so a count is a sum over both sides of one element, remembered by the set of
the undecided; and where these fall into parts that all cross each other, the dual is a
product ([GK] eqn:direct sum) and counts multiply.

Cubes are counted by weighing a cube of dimension ``d`` with ``t**d``: those on either
side of an element, and ``t`` for each cube of the dual of what crosses it. Weights
multiply over products, and with ``t`` a power of two beyond any count the digits of
the sum are the face vector: one number instead of a polynomial.
"""

import math
import random
from collections.abc import Iterator

from neurosnap.poc.order.masks import members, positive

PATIENCE = 5_000
"""Sets of the undecided that are looked at before a size is only estimated."""

_PROBES = 64


class Counter:
    """Counts in the dual of an order.

    Args:
        decided: For each representative of a proper element, the representatives
            whose elements it decides: those above it and their complements.

    Example:
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
        self._weigh(free, 0, self._counts, None)
        return self._counts[free]

    def faces(self, free: int) -> tuple[int, ...]:
        """Return how many cubes of each dimension the dual of `free` has."""
        # A dual of n elements has at most 3**n < 2**(2n) cubes.
        digits = max(free.bit_count(), 1)
        sums: dict[int, int] = {0: 1}
        self._weigh(free, 1 << digits, sums, None)
        total, vector = sums[free], []
        while total:
            vector.append(total & (1 << digits) - 1)
            total >>= digits
        return tuple(vector)

    def sized(self, free: int) -> tuple[int, bool]:
        """Return the number of vertices and whether it is exact.

        Exact if few sets of the undecided need looking at, otherwise the mean over
        random descents of ``2**decisions``, which is right on average (Knuth 1975).
        """
        if self._weigh(free, 0, self._counts, PATIENCE):
            return self._counts[free], True
        chance = random.Random(0)
        return sum(self._probe(free, chance) for _ in range(_PROBES)) // _PROBES, False

    def _probe(self, free: int, chance: random.Random) -> int:
        """Return the size a random descent suggests; products are exact products."""
        size, pending = 1, [free]
        while pending:
            parts = list(self._parts(pending.pop()))
            for part in parts:
                if part in self._counts:
                    size *= self._counts[part]
                    continue
                a = self._pivot(part)
                size *= 2
                pending.append(part & ~self._decided[a ^ chance.getrandbits(1)])
        return size

    def _weigh(
        self, free: int, t: int, sums: dict[int, int], patience: int | None
    ) -> bool:
        """Enter the weight of `free`, and of all it takes; False if out of patience.

        An explicit stack: a chain of decisions is as long as there are elements.
        """
        known, pending = len(sums), [free]
        while pending:
            here = pending[-1]
            if here in sums:
                pending.pop()
                continue
            if patience is not None and len(sums) - known > patience:
                return False
            parts = list(self._parts(here))
            if len(parts) > 1:
                missing = [part for part in parts if part not in sums]
                if not missing:
                    sums[here] = math.prod(sums[part] for part in parts)
            else:
                missing = self._branch(here, t, sums)
            pending += missing
        return True

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


def shown_size(size: int, *, exact: bool) -> str:
    """Return a size for people: ``"1536"``, ``"about 3.3e+150"``.

    Example:
        >>> shown_size(1536, exact=True), shown_size(2**500, exact=False)
        ('1536', 'about 3.2e+150')
    """
    about = "" if exact else "about "
    digits = str(size)
    if len(digits) <= 7:
        return about + digits
    return f"{about}{digits[0]}.{digits[1]}e+{len(digits) - 1}"
