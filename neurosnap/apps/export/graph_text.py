"""The learned order by name, and as text: DOT or GraphML."""

import msgspec
import numpy as np

from neurosnap.errors import MissingExtraError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.recording.replay.births import Births, RecordedBirth
from neurosnap.sensorium import Sensorium
from neurosnap.system.distribution import must_have


class Diagram(msgspec.Struct, frozen=True):
    """What was learned by one tick."""

    tick: int
    sensors: tuple[str, ...]
    height: int
    """Edges on the longest chain."""
    implications: list[tuple[str, str]]
    """Covering pairs between classes, each once with its contrapositive."""
    equivalences: list[tuple[str, ...]]
    """Classes of equivalent literals, each once with its complement."""
    births: tuple[RecordedBirth, ...] = ()
    """Which of the sensors were grown by then, and when."""
    room: int = 0
    """How many more could be grown then."""


def diagram(
    tick: int, graph: PocGraph, sensorium: Sensorium, births: Births | None = None
) -> Diagram:
    """Return the order of `graph` by name.

    Args:
        tick: The tick it was learned by.
        graph: The order.
        sensorium: The names of its sensors.
        births: What the run has grown; None if all sensors were there from the start.
    """
    grown = () if births is None else births.at(tick)
    room = 0 if births is None else births.body.room - len(grown)
    classes = [members for members in graph.classes() if members[0] % 2 == 0]
    standing = graph.representative
    covers = [
        (sensorium.name(below), sensorium.name(above))
        for below, above in np.argwhere(graph.hasse()).tolist()
        if below <= above ^ 1 and standing[below] != standing[above]
    ]
    return Diagram(
        tick=tick,
        sensors=tuple(sensorium)[: len(sensorium) - room],
        height=graph.height(),
        implications=covers,
        equivalences=[tuple(map(sensorium.name, members)) for members in classes],
        births=grown,
        room=room,
    )


def _equivalent(drawn: Diagram) -> list[tuple[str, str]]:
    """Return each class of equivalent literals as a star around its first one."""
    return [
        (members[0], member) for members in drawn.equivalences for member in members[1:]
    ]


def dot(drawn: Diagram) -> str:
    """Return the order for Graphviz."""
    equivalent = _equivalent(drawn)
    names = dict.fromkeys(n for pair in equivalent + drawn.implications for n in pair)
    lines = [f"{_quoted(name)};" for name in names]
    lines += [
        f"{_quoted(one)} -> {_quoted(other)} [dir=none, style=dashed];"
        for one, other in equivalent
    ]
    lines += [
        f"{_quoted(below)} -> {_quoted(above)};" for below, above in drawn.implications
    ]
    return "\n".join(["digraph neurosnap {", "rankdir=BT;", *lines, "}", ""])


def _quoted(name: str) -> str:
    """Return any name as a DOT identifier; bare, ``a:b`` would be a port of ``a``."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def graphml(drawn: Diagram) -> str:
    """Return the order as GraphML.

    Raises:
        MissingExtraError: networkx, which writes it, is not installed.
    """
    try:
        import networkx
    except ImportError as error:
        rule = must_have("networkx", "export")
        raise MissingExtraError(f"out: {rule}") from error
    graph: networkx.DiGraph[str] = networkx.DiGraph(
        tick=drawn.tick, height=drawn.height
    )
    graph.add_edges_from(_equivalent(drawn), kind="equivalent")
    graph.add_edges_from(drawn.implications, kind="implies")
    for birth in drawn.births:
        for name in (birth.name, f"{birth.name}*"):
            if name in graph:
                graph.nodes[name]["born"] = birth.tick
    return "\n".join(networkx.generate_graphml(graph)) + "\n"
