"""Ranks of the elements in a Hasse diagram.

What is below stands below: an element's rank is half its longest chain downwards less
half its longest chain upwards, so that an element and its complement stand at opposite
ranks. Each connected part is laid out by itself; if it holds the complements of its
elements it is its own image under half a turn, otherwise its complements' part stands
beside it. A line that passes a rank has a place of its own there, as elements have
(Sugiyama 1981), so it runs behind no element.
"""

from dataclasses import dataclass

import networkx as nx
import numpy as np

from neurosnap.apps.drawing.component_layout import Part
from neurosnap.apps.drawing.layout_cost import Floats, Indices


@dataclass(frozen=True, slots=True)
class Stand:
    """Where elements stand, and how lines run.

    Attributes:
        across: ``(n,)``: the middles of the elements, from 0 on.
        rank: ``(n,)``: how high they stand, in steps of a half.
        lines: For each joined pair ``(k, 2)``: across and rank, from the lower end up.
    """

    across: Floats
    rank: Floats
    lines: tuple[Floats, ...]


def ranks(covers: Indices, count: int) -> Floats:
    """Return the ranks of elements, in steps of a half.

    Args:
        covers: ``(k, 2)``: each pair is an element and one directly above it.
        count: How many elements there are.

    Example:
        >>> ranks(np.array([[0, 1], [1, 2]]), 3)
        array([-1.,  0.,  1.])
    """
    below, above = np.zeros(count, np.int64), np.zeros(count, np.int64)
    graph = nx.DiGraph(covers.tolist())
    upwards = list(nx.topological_sort(graph))
    for a in upwards:
        for b in graph.successors(a):
            below[b] = max(below[b], below[a] + 1)
    for b in reversed(upwards):
        for a in graph.predecessors(b):
            above[a] = max(above[a], above[b] + 1)
    return (below - above) / 2


def stand(covers: Indices, widths: Floats, mates: Indices, gap: float = 0.2) -> Stand:
    """Return where the elements of an order stand.

    Args:
        covers: As for `ranks`.
        widths: ``(n,)``: how wide each element is; complements are equally wide.
        mates: ``(n,)``: each element's complement.
        gap: What is left free between elements.
    """
    count = len(widths)
    rank = ranks(covers, count)
    graph = nx.Graph(covers.tolist())
    graph.add_nodes_from(range(count))
    across, edge = np.zeros(count), 0.0
    lines: list[Floats] = [np.zeros((0, 2))] * len(covers)
    number = {(a, b): k for k, (a, b) in enumerate(covers.tolist())}
    done = set[int]()
    for part in sorted(sorted(part) for part in nx.connected_components(graph)):
        if part[0] in done:
            continue
        whole = int(mates[part[0]]) in part
        laid = Part(part, covers, rank, widths + gap, mates if whole else None)
        half = widths / 2
        own = laid.place()
        reach = [x for line in own.lines.values() for x in line[:, 0].tolist()]
        left = min([own.across[a] - half[a] for a in part] + reach)
        right = max([own.across[a] + half[a] for a in part] + reach)
        for turned in (False,) if whole else (False, True):
            base = edge + (right if turned else -left)
            sign = -1.0 if turned else 1.0
            for a in part:
                across[mates[a] if turned else a] = base + sign * own.across[a]
            for (a, b), line in own.lines.items():
                pair = (int(mates[b]), int(mates[a])) if turned else (a, b)
                moved = line * sign + [base, 0]
                lines[number[pair]] = moved[::-1] if turned else moved
            done.update(mates[part].tolist() if turned else part)
            edge += right - left + 2 * gap
    return Stand(across, rank, tuple(lines))
