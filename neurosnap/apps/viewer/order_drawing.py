"""The learned order as the page draws it."""

from hashlib import blake2b

import numpy as np

from neurosnap.apps.viewer.api import Arrow, Graph, Node
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium


def graph_id(graph: PocGraph) -> str:
    """Return what tells one order from another.

    The Hasse wiring says all there is to draw, classes included.
    """
    return blake2b(graph.wires("hasse").tobytes(), digest_size=8).hexdigest()


def drawn(name: str, tick: int, graph: PocGraph, sensorium: Sensorium) -> Graph:
    """Return the order of `graph`, whose id is `name`, with its layers. O(N²) time."""
    standing = graph.representative
    heights = graph.heights()
    pairs = np.argwhere(graph.hasse())
    below, above = pairs.T
    chosen = (below <= above ^ 1) & (standing[below] != standing[above])
    return Graph(
        id=name,
        tick=tick,
        height=graph.height(),
        nodes=[
            Node(
                sensor=sensor,
                name=name,
                layer=int(heights[2 * sensor]),
                complement_layer=int(heights[2 * sensor + 1]),
                group=int(standing[2 * sensor]),
            )
            for sensor, name in enumerate(sensorium)
        ],
        edges=[
            Arrow(source=a, target=b, kind="inhibit" if b & 1 else "excite")
            for a, b in pairs[chosen].tolist()
        ],
        classes=[members for members in graph.classes() if members[0] % 2 == 0],
    )
