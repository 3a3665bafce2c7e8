"""Explains why an observation contradicts an order.

An observation is incoherent iff it holds some ``a`` and ``b`` with ``a <= b*``: the
order says ``a`` implies ``b*``, and ``b`` is what was seen. The pairs of sensors that
clash so make a graph; leaving out the sensors of a vertex cover of it leaves a coherent
observation, and nothing less does. So the fewest sensors that can be to blame are a
smallest vertex cover. That the fewest are to blame is an assumption, and the only one.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.conflicts import conflict_rows, shortest_chains
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import Literals, as_literals, to_words
from neurosnap.poc.order.masks import members, to_mask
from neurosnap.poc.order.vertex_cover import PATIENCE, smallest_cover
from neurosnap.sensorium import complement

CHAINS = 1_024
"""The most chains that are listed."""
_LOOKS = 20_000  # literals looked at on the way of chains


@dataclass(frozen=True, slots=True)
class Contradiction:
    """How an observation breaks an order ([GK] defn:coherence); empty if it does not.

    An implication ``a -> c`` is broken iff ``a <= c`` while ``a`` and ``c*`` were
    observed. It stands for its contrapositive ``c* -> a*`` too: of the two it is the
    one with the smaller source.
    """

    chains: tuple[tuple[int, ...], ...]
    """Why: for each broken ``a -> c`` that follows from no other two, a shortest way
    from ``a`` to ``c`` along `PocGraph.hasse`, through sensors without a reading. It is
    two literals, a learned implication, wherever every sensor has one."""
    more: int
    """For how many such implications, at least, none is listed."""
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
        return not self.culprits


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
        O(N²/64) time if it is coherent. If not, O(k N/64) for ``k`` literals in
        conflict, O(1) for each two of them, and the search for the culprits.

    Raises:
        ShapeError: `observed` or `suspicion` has another shape.
        InvalidValueError: `observed` holds a literal and its complement, or an entry
            that is no literal; or `suspicion` is not finite.

    Example:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> found = contradiction(g, [0, 3, 5])
        >>> found.chains, found.culprits
        (((0, 2),), (0,))
        >>> contradiction(g, [0, 5]).chains
        ((0, 2, 4),)
    """
    seen = as_literals("observed", observed, len(graph))
    both = seen[::2] & seen[1::2]
    if both.any():
        rule = "must not hold a literal and its complement"
        raise InvalidValueError("observed", rule, int(2 * both.argmax()))
    worth = _checked(suspicion, graph.sensors)
    # Whatever is below the complement of something seen has it above its own.
    clashing = (seen & complement(graph.up(seen))).nonzero()[0]
    if not len(clashing):
        return Contradiction((), 0, (), (), exact=True)
    rows = conflict_rows(graph.closed, clashing, to_words(complement(seen)))
    vertices = np.arange(len(rows))
    # A literal below its own complement is to blame by itself.
    alone = rows[vertices, vertices >> 6] >> (vertices & 63).astype(np.uint64) & 1 > 0
    if alone.any():
        rows &= ~to_words(alone)
        rows[alone] = 0
    sensors = clashing >> 1
    cover = smallest_cover(rows, worth[sensors], patience)
    edges = graph.wire_list("hasse")
    literals, ends, more = shortest_chains(
        np.searchsorted(edges, np.arange(len(graph) + 1) << 32),
        edges & 0xFFFFFFFF,
        clashing,
        seen,
        CHAINS,
        _LOOKS,
    )
    mask, way, stops = to_mask(alone), literals.tolist(), [0, *ends.tolist()]
    return Contradiction(
        chains=tuple(tuple(way[low:high]) for low, high in pairwise(stops)),
        more=int(more),
        culprits=tuple(sensors[list(members(mask | cover.chosen))].tolist()),
        candidates=tuple(sensors[list(members(mask | cover.candidates))].tolist()),
        exact=cover.exact,
    )


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
