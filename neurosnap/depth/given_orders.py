"""Orders of up to millions of sensors, given as lists of edges."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import WiringKind
from neurosnap.protocol.worker_shares import shares


@dataclass(frozen=True, eq=False)
class GivenOrder:
    """An order on the literals of some sensors, and a signal to send through it."""

    sensors: int
    edges: NDArray[np.int64]
    """``(e,)``, ascending: what signals travel along, each edge with its
    contrapositive; source above the 32nd bit, target below."""
    signal: tuple[int, ...]
    """Literals, ascending."""
    height: int
    """Edges on the longest chain, and on the longest that starts in the signal."""

    def reach(self) -> NDArray[np.bool_]:
        """Return everything above the signal, itself included.

        Returns:
            ``(2N,)``. O(h e) time, for edges ``h`` hops deep.
        """
        sources, targets = self.edges >> 32, self.edges & 0xFFFFFFFF
        reached = np.zeros(2 * self.sensors, np.bool_)
        reached[list(self.signal)] = True
        while True:
            further = targets[reached[sources]]
            if reached[further].all():
                return reached
            reached[further] = True


def chain(sensors: int, height: int, wiring: WiringKind = "hasse") -> GivenOrder:
    """Return the chain ``0 < 2 < 4 < …`` on the first sensors; the signal is its least.

    Args:
        sensors: How many there are; more than `height`.
        height: Edges on the chain.
        wiring: ``"hasse"``: an edge from each to the next. ``"derived"``: to all above,
            as a graph derived from weights has.
    """
    below, above = np.triu_indices(height + 1, 1)
    if wiring == "hasse":
        below, above = np.arange(height), np.arange(1, height + 1)
    return GivenOrder(sensors, _closed(below, above), (0,), height)


def layered(sensors: int, height: int, edges: int, seed: int) -> GivenOrder:
    """Return a random order of `height` + 1 layers; the signal is the lowest.

    Every sensor that is not in the lowest layer is above one of the next lower, at
    least. Edges lead from a layer to the next, so each is a cover: nothing is between.

    Args:
        sensors: How many there are. Which is in which layer is drawn, so that their
            numbers say nothing of it.
        height: At least 1.
        edges: How many there are, contrapositives counted.
        seed: Draws the order.

    Raises:
        InvalidValueError: There is no such order.
    """
    check_layers(sensors, height, edges)
    draw = np.random.default_rng(seed)
    drawn = draw.permutation(sensors)
    layers = [drawn[layer.start : layer.stop] for layer in shares(sensors, height + 1)]
    covers = [draw.choice(a, len(b)) << 32 | b for a, b in pairwise(layers)]
    rooms = np.array([len(a) * len(b) for a, b in pairwise(layers)])
    found = np.sort(np.concatenate(covers))
    while len(found) < edges // 2:
        counts = draw.multinomial(edges // 2 - len(found), rooms / rooms.sum())
        more = [
            draw.choice(a, count) << 32 | draw.choice(b, count)
            for count, (a, b) in zip(counts, pairwise(layers), strict=True)
        ]
        found = np.union1d(found, np.concatenate(more))
    signal = tuple(np.sort(2 * layers[0]).tolist())
    return GivenOrder(sensors, _closed(found >> 32, found & 0xFFFFFFFF), signal, height)


def check_layers(sensors: int, height: int, edges: int) -> None:
    """Raise InvalidValueError if there is no order for `layered` to draw."""
    if not 1 <= height < sensors:
        rule = f"must be at least 1 and below the sensors, {sensors}"
        raise InvalidValueError("height", rule, height)
    sizes = [len(layer) for layer in shares(sensors, height + 1)]
    least = 2 * (sensors - sizes[0])
    most = 2 * sum(low * high for low, high in pairwise(sizes))
    if edges % 2 or not least <= edges <= most:
        raise InvalidValueError("edges", f"must be even, {least} to {most}", edges)


def _closed(below: NDArray[np.int64], above: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return edges between sensors' own literals, and their contrapositives."""
    own = 2 * below << 32 | 2 * above
    contrapositive = 2 * above + 1 << 32 | 2 * below + 1
    return np.sort(np.concatenate((own, contrapositive)))
