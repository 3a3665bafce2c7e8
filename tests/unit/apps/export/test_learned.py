"""The learned order by name, in each of its forms."""

import io
import re
from pathlib import Path

import networkx
import numpy as np
import pytest

from neurosnap.apps.export.learned import Diagram, diagram, dot, graphml, learned_from
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import Sensorium
from tests.support.lamp import BIRTH, GROWN, lamp_options
from tests.support.recorded_runs import recorded

AWKWARD = [
    *("x:y", "x", "node", "learn", "two words", 'a "quote"', "back\\slash", "end\\"),
    *("<b>", "3.5", "1st", "a,b", "ünï → ∧", "a*b", "{;}", "->"),
]


@pytest.mark.parametrize(
    ("pairs", "implications", "equivalences"),
    [
        # s0 = s1, both below s2; s2 and s3 exclude each other.
        (
            [(0, 2), (2, 0), (2, 4), (4, 7)],
            [("s0", "s2"), ("s2", "s3*")],
            [("s0", "s1")],
        ),
        ([(0, 1)], [("s0", "s0*")], []),  # what contradicts itself
        ([(1, 2), (2, 1), (2, 4)], [("s0*", "s2")], [("s0", "s1*")]),
        ([], [], []),
    ],
)
def test_it_holds_every_covering_pair_once_with_its_contrapositive(
    pairs: list[tuple[int, int]],
    implications: list[tuple[str, str]],
    equivalences: list[tuple[str, ...]],
) -> None:
    order, names = PocGraph.from_implications(4, pairs), Sensorium.of(4)
    found = diagram(9, order, names)
    assert (found.tick, found.height) == (9, order.height())
    assert found.sensors == names.names
    assert (found.implications, found.equivalences) == (implications, equivalences)
    assert ("->" in dot(found)) == bool(pairs)


def test_implications_and_their_contrapositives_are_the_whole_order() -> None:
    generator = np.random.default_rng(4)
    snapshot = EmpiricalSnapshot(6, threshold=0.2)
    hidden = generator.random((40, 3)) < 0.5
    for a, b, c in hidden:
        snapshot.observe(np.array([a, a, a or b, a or b or c, not c, b]))
    order, names = snapshot.poc_graph(), snapshot.sensorium
    found = diagram(40, order, names)
    pairs = [(names.literal(a), names.literal(b)) for a, b in found.implications]
    for members in found.equivalences:
        head, *rest = map(names.literal, members)
        pairs += [pair for m in rest for pair in ((head, m), (m, head))]
    rebuilt = PocGraph.from_implications(6, pairs)
    for literal in range(12):
        assert np.array_equal(rebuilt.up([literal]), order.up([literal]))
    assert len(found.implications) > 2
    assert found.equivalences


def awkward() -> Diagram:
    """Return an order of sensors whose names mean something in one of the forms."""
    pairs = [(2 * k, 2 * k + 2) for k in range(len(AWKWARD) - 1)]
    order = PocGraph.from_implications(len(AWKWARD), [*pairs, (4, 0)])
    return diagram(1, order, Sensorium(AWKWARD))


def equivalent_in(found: Diagram) -> set[tuple[str, str]]:
    return {
        (members[0], other) for members in found.equivalences for other in members[1:]
    }


def test_graphml_reads_back_as_the_same_graph() -> None:
    found = awkward()
    graph = networkx.read_graphml(io.BytesIO(graphml(found).encode()))
    kinds: dict[str, set[tuple[str, str]]] = {"implies": set(), "equivalent": set()}
    for a, b, kind in graph.edges(data="kind"):
        kinds[kind].add((a, b))
    assert kinds["implies"] == set(found.implications)
    assert kinds["equivalent"] == equivalent_in(found)
    assert graph.graph == {**graph.graph, "tick": found.tick, "height": found.height}


QUOTED = r'"(?:[^"\\]|\\.)*"'


def unquoted(identifier: str) -> str:
    return re.sub(r"\\(.)", r"\1", identifier[1:-1])


def test_dot_holds_every_node_and_edge_with_its_name_quoted() -> None:
    found = awkward()
    first, *lines, last = dot(found).strip().splitlines()
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
    assert equivalent == equivalent_in(found) != set()
    assert nodes == {name for pair in implies | equivalent for name in pair}


def test_what_is_grown_is_in_the_order_from_its_birth_on(tmp_path: Path) -> None:
    options = lamp_options(ticks=40, cells="inline")
    recording = Recording.open(recorded(options, tmp_path / "lamp.mcap"))
    for at, sensors in ((BIRTH - 1, 24), (BIRTH, 25)):
        learned = learned_from("lamp", recording, at=at)
        assert f" of {sensors} sensors in {at} ticks" in learned.title
        order = learned.order()
        assert (len(order.sensors), order.room) == (sensors, 27 - sensors)
        born = [(each.tick, each.name) for each in order.births]
        assert born == [(BIRTH, GROWN)] * (sensors - 24)
        graph = networkx.read_graphml(io.BytesIO(graphml(order).encode()))
        ticks = {n: tick for n, tick in graph.nodes(data="born") if tick is not None}
        assert set(ticks) <= {GROWN, f"{GROWN}*"}
        assert set(ticks.values()) == {tick for tick, _ in born}
