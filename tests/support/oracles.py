"""Slow reference implementations in plain loops.

Nothing here uses the code under test. Literals are ints, sets are sets, a relation is
the set of its edges; ``n`` is the number of literals.
"""

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TypeAlias

Edges: TypeAlias = set[tuple[int, int]]
Number: TypeAlias = int | float | Fraction
Weights: TypeAlias = dict[tuple[int, int], Number]


def proper_pairs(n: int) -> list[tuple[int, int]]:
    """All ordered pairs of literals of different sensors."""
    return [(a, b) for a in range(n) for b in range(n) if a // 2 != b // 2]


def holds(bits: list[bool], literal: int) -> bool:
    """Whether a literal is on in an observation."""
    return bits[literal // 2] != bool(literal % 2)


def counted(n: int, seen: list[list[bool]]) -> Weights:
    """The weights of the empirical snapshot, from the raw observations."""
    return {
        (a, b): sum(holds(bits, a) and holds(bits, b) for bits in seen)
        for a, b in proper_pairs(n)
    }


def implied(
    n: int, w: Weights, limit: Callable[[int, int], Number], slack: Number = 0
) -> Edges:
    """``a -> b`` iff ``w_ab* < min(limit, w_ab, w_a*b, w_a*b*)``."""
    return {
        (a, b)
        for a, b in proper_pairs(n)
        if w[a, b ^ 1]
        < min(limit(a // 2, b // 2), w[a, b], w[a ^ 1, b], w[a ^ 1, b ^ 1]) - slack
    }


def equal(n: int, w: Weights, slack: Number = 0) -> Edges:
    """``a <-> b`` iff ``w_ab* = w_a*b = 0``."""
    return {
        (a, b)
        for a, b in proper_pairs(n)
        if w[a, b ^ 1] <= slack and w[a ^ 1, b] <= slack
    }


def discounted(n: int, w: Weights, bits: list[bool], decay: Number) -> Weights:
    """One discounted update, without truncation."""
    return {
        (a, b): decay * w[a, b] + (1 - decay) * (holds(bits, a) and holds(bits, b))
        for a, b in proper_pairs(n)
    }


def truncated(w: Weights, edges: Edges) -> Weights:
    """Move the weight against each implication to where it does no harm."""
    new = dict(w)
    for a, b in edges:
        against = w[a, b ^ 1]
        for pair, value in [
            ((a, b ^ 1), 0 * against),
            ((a, b), w[a, b] + against),
            ((a ^ 1, b ^ 1), w[a ^ 1, b ^ 1] + against),
            ((a ^ 1, b), w[a ^ 1, b] - against),
        ]:
            new[pair] = new[pair[::-1]] = value
    return new


def next_to(edges: Edges) -> dict[int, list[int]]:
    """Where the edges from each literal lead."""
    found: dict[int, list[int]] = {}
    for a, b in edges:
        found.setdefault(a, []).append(b)
    return found


def reach(edges: Edges, start: Iterable[int]) -> set[int]:
    """All that paths lead to, by depth-first search."""
    return _reach(next_to(edges), start)


def _reach(nearby: dict[int, list[int]], start: Iterable[int]) -> set[int]:
    found: set[int] = set()
    pending = list(start)
    while pending:
        a = pending.pop()
        if a not in found:
            found.add(a)
            pending += nearby.get(a, ())
    return found


def below_or_equal(n: int, edges: Edges) -> Edges:
    """The reflexive and transitive closure."""
    nearby = next_to(edges)
    return {(a, b) for a in range(n) for b in _reach(nearby, [a])}


def stars(literals: Iterable[int]) -> set[int]:
    """The complements."""
    return {a ^ 1 for a in literals}


def coherent(order: Edges, literals: set[int]) -> bool:
    """No ``a, b`` in the set with ``a <= b*``."""
    return not any((a, b ^ 1) in order for a in literals for b in literals)


def projected(edges: Edges, literals: Iterable[int]) -> set[int]:
    """``up(A) - up(A)*``."""
    above = reach(edges, literals)
    return above - stars(above)


def hops(edges: Edges, start: set[int]) -> int:
    """How many rounds pass until nothing new is reached."""
    reached, rounds = set(start), 0
    while True:
        more = {b for a, b in edges if a in reached} - reached
        if not more:
            return rounds
        reached |= more
        rounds += 1


def chain(order: Edges, a: int) -> int:
    """The edges on the longest chain of inequivalent literals up from `a`."""
    above = [b for x, b in order if x == a and (b, a) not in order]
    return max((1 + chain(order, b) for b in above), default=0)


def has_cycle(edges: Edges) -> bool:
    """Whether a path leads back to where it began."""
    nearby = next_to(edges)
    return any(a in _reach(nearby, [b]) for a, b in edges)
