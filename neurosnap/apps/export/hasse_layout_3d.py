"""A 3D layout of an order: what implies another stands below it.

A literal's height is half its longest chain downwards less half its longest chain
upwards. Around the axis every sensor has a direction of its own, and the complement
stands opposite. So a literal and its complement are each other's image in the origin,
and a literal only ever moves up or down while the order is learned.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.graph import PocGraph

_ROOM = 0.8
"""Between neighbours on the circle; heights are 1 apart or 1/2."""


def arranged(graph: PocGraph) -> NDArray[np.float64]:
    """Return where literals stand: ``(2N, 3)``.

    Every edge between classes leads up by 1 or more; equivalent literals stand at the
    same height.
    """
    literals = np.arange(len(graph))
    above = graph.heights().astype(np.float64)
    # What is below a literal is the complement of what is above its complement.
    height = (above[literals ^ 1] - above) / 2
    turn = np.pi * (literals >> 1) / max(1, graph.sensors) + np.pi * (literals & 1)
    far = radius(graph.sensors)
    return np.stack([far * np.cos(turn), far * np.sin(turn), height], axis=1)


def radius(sensors: int) -> float:
    """Return how far from the axis the literals of so many sensors stand."""
    return max(1.0, _ROOM * sensors / np.pi)


def reach(sensors: int, height: int) -> float:
    """Return how far from the origin literals stand at most.

    Args:
        sensors: How many there are.
        height: Edges on the longest chain of their order; no literal stands more than
            half of that above the origin, or below it.
    """
    return float(np.hypot(radius(sensors), height / 2))
