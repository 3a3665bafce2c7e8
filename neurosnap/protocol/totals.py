"""What a run comes to, as the coordinator counts it."""

import msgspec


class Totals(msgspec.Struct, kw_only=True):
    """What a run came to."""

    ticks: int = 0
    """Observations learned from, each with its state."""
    waves: int = 0
    """Waves started."""
    pulses: int = 0
    """Pulses sent in the waves that settled."""
    depth: int = 0
    """The deepest wave's hops."""
    height: int = 0
    """The height of the order at the end."""
    edges: int = 0
    """Edges of its Hasse wiring, an edge and its contrapositive counted as one."""
    incoherent: int = 0
    """Observations that contradicted what was learned."""
    anomalies: int = 0
    """Observations that contradicted what was believed before they were learned."""
    told: int = 0
    """Those of them that have the support that the run asks for."""
    faults: int = 0
    """Messages dropped as bad or unexpected."""
    grown: int = 0
    """Sensors that were grown."""
    retired: int = 0
    """Those of them that are not read any more."""
