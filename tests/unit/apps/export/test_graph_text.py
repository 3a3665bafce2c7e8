"""The learned order by name, in each of its forms."""

import io
import re

import networkx
import numpy as np
import pytest

from neurosnap.apps.export.graph_text import Diagram, diagram, render
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium

NAMES = Sensorium(["door", "motion", "light", "quiet"])
# door = motion, both below light; light and quiet exclude each other.
ORDER = PocGraph.from_implications(4, [(0, 2), (2, 0), (2, 4), (4, 7)])
AWKWARD = [
    "x:y",
    "x",
    "node",
    "learn",
    "two words",
    'a "quote"',
    "back\\slash",
    "end\\",
    "<b>",
    "3.5",
    "1st",
    "a,b",
    "ünï → ∧",
    "a*b",
    "{;}",
    "-> ",
]


def drawn() -> Diagram:
    return diagram(9, ORDER, NAMES)


def test_it_holds_every_covering_pair_once_with_its_contrapositive() -> None:
    found = drawn()
    assert found.tick == 9
    assert found.sensors == NAMES.names
    assert found.height == ORDER.height() == 2
    assert found.implications == [("door", "light"), ("light", "quiet*")]
    assert found.equivalences == [("door", "motion")]


def test_what_contradicts_itself_is_an_implication_of_its_own() -> None:
    found = diagram(1, PocGraph.from_implications(2, [(0, 1)]), Sensorium.of(2))
    assert found.implications == [("s0", "s0*")]
    assert found.equivalences == []


def test_an_equivalence_may_hold_a_complement() -> None:
    order = PocGraph.from_implications(3, [(1, 2), (2, 1), (2, 4)])
    found = diagram(1, order, Sensorium(["a", "b", "c"]))
    assert found.equivalences == [("a", "b*")]
    # One way round or the other, never both.
    assert found.implications in ([("a*", "c")], [("c*", "a")])


def test_implications_and_their_contrapositives_are_the_whole_order() -> None:
    generator = np.random.default_rng(4)
    snapshot = EmpiricalSnapshot(6, threshold=0.2)
    hidden = generator.random((40, 3)) < 0.5
    for a, b, c in hidden:
        snapshot.observe(np.array([a, a, a or b, a or b or c, not c, b]))
    order = snapshot.poc_graph()
    found = diagram(40, order, snapshot.sensorium)
    names = snapshot.sensorium
    pairs = [(names.literal(a), names.literal(b)) for a, b in found.implications]
    for members in found.equivalences:
        head, *rest = map(names.literal, members)
        pairs += [pair for m in rest for pair in ((head, m), (m, head))]
    rebuilt = PocGraph.from_implications(6, pairs)
    for literal in range(12):
        assert np.array_equal(rebuilt.up([literal]), order.up([literal]))
    assert len(found.implications) > 2
    assert found.equivalences


def test_nothing_learned_is_an_empty_diagram() -> None:
    found = diagram(0, PocGraph.from_implications(4, []), NAMES)
    assert (found.height, found.implications, found.equivalences) == (0, [], [])
    assert "->" not in render(found, "dot")


def awkward() -> Diagram:
    """Return a chain of sensors whose names mean something in one of the forms."""
    names = Sensorium(name.strip() for name in AWKWARD)
    pairs = [(2 * k, 2 * k + 2) for k in range(len(names) - 1)]
    return diagram(1, PocGraph.from_implications(len(names), pairs), names)


@pytest.mark.parametrize("found", [drawn(), awkward()], ids=["plain", "awkward"])
def test_graphml_reads_back_as_the_same_graph(found: Diagram) -> None:
    text = render(found, "graphml")
    graph = networkx.read_graphml(io.BytesIO(text.encode()))
    kinds = {(a, b): kind for a, b, kind in graph.edges(data="kind")}
    assert {pair for pair, kind in kinds.items() if kind == "implies"} == set(
        found.implications
    )
    assert {pair for pair, kind in kinds.items() if kind == "equivalent"} == {
        (members[0], other) for members in found.equivalences for other in members[1:]
    }
    assert graph.graph["tick"] == found.tick
    assert graph.graph["height"] == found.height


QUOTED = r'"(?:[^"\\]|\\.)*"'


def unquoted(identifier: str) -> str:
    return re.sub(r"\\(.)", r"\1", identifier[1:-1])


@pytest.mark.parametrize("found", [drawn(), awkward()], ids=["plain", "awkward"])
def test_dot_holds_every_node_and_edge_with_its_name_quoted(found: Diagram) -> None:
    first, *lines, last = render(found, "dot").strip().splitlines()
    assert (first, lines[0], last) == ("digraph neurosnap {", "rankdir=BT;", "}")
    nodes: set[str] = set()
    implies: set[tuple[str, str]] = set()
    equivalent: set[tuple[str, str]] = set()
    for line in lines[1:]:
        edge = re.fullmatch(rf"({QUOTED})\s*->\s*({QUOTED})\s*(\[.*\])?;", line)
        if edge is None:
            node = re.fullmatch(rf"({QUOTED});", line)
            assert node is not None, line
            nodes.add(unquoted(node[1]))
        else:
            pairs = implies if edge[3] is None else equivalent
            pairs.add((unquoted(edge[1]), unquoted(edge[2])))
    assert implies == set(found.implications)
    assert equivalent == {
        (members[0], other) for members in found.equivalences for other in members[1:]
    }
    assert nodes == {name for pair in implies | equivalent for name in pair}
