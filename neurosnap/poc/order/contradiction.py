"""Explains why an observation contradicts an order.

An observation is incoherent iff it holds some ``a`` and ``b`` with ``a <= b*``: the
order says ``a`` implies ``b*``, and ``b`` is what was seen. The pairs of sensors that
clash so make a graph; leaving out the sensors of a vertex cover of it leaves a coherent
observation, and nothing less does. So the fewest sensors that can be to blame are a
smallest vertex cover. That the fewest are to blame is an assumption, and the only one.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import Literals, Words, as_literals, from_words
from neurosnap.poc.order.masks import members
from neurosnap.poc.order.vertex_cover import PATIENCE, smallest_cover
from neurosnap.sensorium import complement


@dataclass(frozen=True, slots=True)
class Contradiction:
    """How an observation breaks an order ([GK] defn:coherence); empty if it does not.

    An implication ``a -> c`` is broken iff ``a <= c`` while ``a`` and ``c*`` were
    observed. It stands for its contrapositive ``c* -> a*`` too: of the two it is the
    one with the smaller source.
    """

    broken: tuple[tuple[int, int], ...]
    """All broken implications, sorted. ``(a, a*)`` is a literal that is never on."""
    chains: tuple[tuple[int, ...], ...]
    """Why: for each broken ``a -> c`` that follows from no other two, a shortest way
    from ``a`` to ``c`` along `PocGraph.hasse`, through sensors without a reading. It is
    two literals, a learned implication, wherever every sensor has one."""
    culprits: tuple[int, ...]
    """Sensors, ascending: the fewest to leave out that the rest is coherent."""
    candidates: tuple[int, ...]
    """Sensors, ascending: all that are in some such set of the fewest."""
    exact: bool
    """Whether the search was complete. If not, leaving out the culprits helps and
    leaving out fewer of them does not, but others may do with fewer; and candidates
    may be too many."""

    @property
    def coherent(self) -> bool:
        """Whether there is none."""
        return not self.broken


def contradiction(
    graph: PocGraph,
    observed: Literals,
    suspicion: ArrayLike | None = None,
    *,
    patience: int = PATIENCE,
) -> Contradiction:
    """Return how an observation contradicts an order.

    Args:
        graph: The order.
        observed: A *-selection: one literal of every sensor that has a reading.
        suspicion: ``(N,)``, finite: of several smallest sets of culprits, the one with
            the largest sum is returned; of several of those, the first in order. None:
            all alike.
        patience: As for `smallest_cover`: beyond it, culprits are found greedily.

    Cost:
        O(N²/64) time if it is coherent; as much for each literal in conflict, if not,
        and the search for the culprits.

    Raises:
        ShapeError: `observed` or `suspicion` has another shape.
        InvalidValueError: `observed` holds a literal and its complement, or an entry
            that is no literal; or `suspicion` is not finite.

    Example:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> found = contradiction(g, [0, 3, 5])
        >>> found.broken, found.chains, found.culprits
        (((0, 2), (0, 4)), ((0, 2),), (0,))
        >>> contradiction(g, [0, 5]).chains
        ((0, 2, 4),)
    """
    seen = as_literals("observed", observed, len(graph))
    both = seen[::2] & seen[1::2]
    if both.any():
        rule = "must not hold a literal and its complement"
        raise InvalidValueError("observed", rule, int(2 * both.argmax()))
    worth = _checked(suspicion, graph.sensors)
    denied = complement(seen)
    # Whatever is below the complement of something seen has it above its own.
    clashing = (seen & complement(graph.up(seen))).nonzero()[0].tolist()
    if not clashing:
        return Contradiction((), (), (), (), exact=True)
    above = {a: (graph.up([a]) & denied).nonzero()[0].tolist() for a in clashing}
    neighbours: dict[int, int] = {}
    for a, broken in above.items():
        neighbours[a >> 1] = sum(1 << (c >> 1) for c in broken)
    alone = sum(1 << (a >> 1) for a in clashing if a ^ 1 in above[a])
    rest = {
        v: around & ~alone
        for v, around in neighbours.items()
        if not alone >> v & 1 and around & ~alone
    }
    cover = smallest_cover(rest, worth.tolist(), patience)
    wires = graph.wires("hasse")
    return Contradiction(
        broken=tuple((a, c) for a in clashing for c in above[a] if a <= c ^ 1),
        chains=tuple(
            chain
            for a in clashing
            for chain in _chains(wires, seen, a)
            if a <= chain[-1] ^ 1
        ),
        culprits=tuple(members(alone | cover.chosen)),
        candidates=tuple(members(alone | cover.candidates)),
        exact=cover.exact,
    )


def _chains(
    wires: Words, seen: NDArray[np.bool_], start: int
) -> Iterator[tuple[int, ...]]:
    """Yield a shortest way from a literal to each that was denied, past none observed.

    Along any way from something seen to something denied there is a last literal seen
    before the first one denied: between those two lie sensors without a reading.
    """
    denied = complement(seen)
    came = {start: start}
    ring = [start]
    while ring:
        following = []
        for a in ring:
            for b in from_words(wires[a], len(seen)).nonzero()[0].tolist():
                if b in came or seen[b]:
                    continue
                came[b] = a
                if not denied[b]:
                    following.append(b)
                    continue
                chain = [b]
                while chain[-1] != start:
                    chain.append(came[chain[-1]])
                yield tuple(reversed(chain))
        ring = following


def _checked(suspicion: ArrayLike | None, sensors: int) -> NDArray[np.float64]:
    """Return the suspicion as an array."""
    if suspicion is None:
        return np.zeros(sensors)
    worth = np.asarray(suspicion, np.float64)
    if worth.shape != (sensors,):
        raise ShapeError("suspicion", f"must be ({sensors},)", worth.shape)
    if not np.isfinite(worth).all():
        value = worth[~np.isfinite(worth)][0].item()
        raise InvalidValueError("suspicion", "must be finite", value)
    return worth
