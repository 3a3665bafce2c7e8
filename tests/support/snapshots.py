"""What a snapshot has learned, as sets and dictionaries."""

from neurosnap.poc.learning.snapshot import Snapshot
from tests.support.edges import edges_of
from tests.support.oracles import Edges, proper_pairs


def learned_edges(snapshot: Snapshot, equivalences: bool = True) -> Edges:
    """Return the edges of its graph."""
    return edges_of(snapshot.poc_graph(equivalences).edges)


def weights_of(snapshot: Snapshot) -> dict[tuple[int, int], float]:
    """Return its weights of pairs of literals of different sensors."""
    pairs = proper_pairs(2 * len(snapshot.sensorium))
    return {(a, b): snapshot.weight(a, b) for a, b in pairs}
