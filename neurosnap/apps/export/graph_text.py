"""The learned order as text: names, JSON, DOT or GraphML."""

import io
from typing import Literal, TypeAlias

import msgspec
import networkx
import numpy as np
import pydot

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.recording.read.births import Birth, Births
from neurosnap.sensorium import Sensorium

Format: TypeAlias = Literal["json", "dot", "graphml"]


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
    births: tuple[Birth, ...] = ()
    """Which of the sensors were grown by then, and when."""
    room: int = 0
    """How many more could be grown then."""


def parse_format(name: str) -> Format:
    """Return the format called `name`.

    Raises:
        InvalidValueError: There is none of that name.
    """
    match name:
        case "json" | "dot" | "graphml":
            return name
        case _:
            rule = "must be table, json, dot or graphml"
            raise InvalidValueError("format", rule, name)


def diagram(
    tick: int, graph: PocGraph, sensorium: Sensorium, births: Births | None = None
) -> Diagram:
    """Return the order of `graph` by name.

    Args:
        tick: The tick it was learned by.
        graph: The order.
        sensorium: The names of its sensors.
        births: What the run has grown; None: all sensors were there from the start.
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


def render(drawn: Diagram, form: Format) -> str:
    """Return `drawn` as text in one of the formats."""
    if form == "json":
        return msgspec.json.format(msgspec.json.encode(drawn)).decode()
    graph = _network(drawn)
    return _dot(graph) if form == "dot" else _graphml(graph)


def _network(drawn: Diagram) -> "networkx.DiGraph[str]":
    """Return the implications as edges between named literals."""
    graph: networkx.DiGraph[str] = networkx.DiGraph(
        tick=drawn.tick, height=drawn.height
    )
    for members in drawn.equivalences:
        for member in members[1:]:
            graph.add_edge(members[0], member, kind="equivalent")
    for below, above in drawn.implications:
        graph.add_edge(below, above, kind="implies")
    for birth in drawn.births:
        for name in (birth.name, f"{birth.name}*"):
            if name in graph:
                graph.nodes[name]["born"] = birth.tick
    return graph


def _dot(graph: "networkx.DiGraph[str]") -> str:
    drawing = pydot.Dot("neurosnap", graph_type="digraph", rankdir="BT")
    for name in graph:
        drawing.add_node(pydot.Node(_quoted(name)))
    for below, above, kind in graph.edges(data="kind"):
        edge = pydot.Edge(_quoted(below), _quoted(above))
        if kind == "equivalent":
            edge.set("dir", "none")
            edge.set("style", "dashed")
        drawing.add_edge(edge)
    return str(drawing.to_string())


def _quoted(name: str) -> str:
    """Return any name as a DOT identifier; bare, ``a:b`` would be a port of ``a``."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _graphml(graph: "networkx.DiGraph[str]") -> str:
    buffer = io.BytesIO()
    networkx.write_graphml(graph, buffer)
    return buffer.getvalue().decode()
