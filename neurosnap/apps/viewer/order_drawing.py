"""The learned order as the page draws it."""

from hashlib import blake2b

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.apps.viewer.api import Arrow, Graph, Node
from neurosnap.poc.order.graph import PocGraph


def graph_id(graph: PocGraph, body: Body) -> str:
    """Return what tells one order from another.

    The Hasse wiring says all there is to draw, classes included, but for which sensors
    are read.
    """
    wires = blake2b(graph.wires("hasse").tobytes(), digest_size=8)
    wires.update(repr((body.grown, body.retired)).encode())
    return wires.hexdigest()


def drawn(name: str, tick: int, graph: PocGraph, body: Body) -> Graph:
    """Return the order of `graph`, whose id is `name`, with its layers. O(N²) time.

    Sensors still to be grown are not drawn, and retired ones where they are still in
    the order.
    """
    names = body.sensors
    pairs = np.argwhere(graph.hasse())
    shown = sorted({*body.read, *(pairs >> 1).ravel().tolist()})
    standing = graph.representative
    heights = graph.heights()
    below, above = pairs.T
    chosen = (below <= above ^ 1) & (standing[below] != standing[above])
    return Graph(
        id=name,
        tick=tick,
        height=graph.height(),
        nodes=[
            Node(
                sensor=sensor,
                name=names[sensor],
                layer=int(heights[2 * sensor]),
                complement_layer=int(heights[2 * sensor + 1]),
                group=int(standing[2 * sensor]),
            )
            for sensor in shown
        ],
        edges=[
            Arrow(source=a, target=b, kind="inhibit" if b & 1 else "excite")
            for a, b in pairs[chosen].tolist()
        ],
        classes=[members for members in graph.classes() if members[0] % 2 == 0],
    )
