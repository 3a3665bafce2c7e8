"""What differs between two ticks: of one recording, or of two."""

import msgspec

from neurosnap.apps.viewer.api import Arrow, Bit, Frame
from neurosnap.apps.viewer.order_difference import (
    literals_of,
    only_equal,
    only_in,
    restricted,
)
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.order.graph import PocGraph

MOST = 200
"""Edges and classes of a kind that are listed."""


class Felt(msgspec.Struct, frozen=True, kw_only=True):
    """A sensor that is not the same."""

    sensor: int
    """Its number here."""
    name: str
    reads: tuple[Bit, Bit]
    """What it reads here and there."""
    state: tuple[Bit, Bit]
    """What the state has of it here and there."""
    contradicted: tuple[bool, bool]
    """Whether it is contradicted here and there."""


class Only(msgspec.Struct, frozen=True, kw_only=True):
    """What one order has and the other lacks; literals are numbered as here."""

    edges: list[Arrow]
    """Covering edges that the other does not imply, the first `MOST` of them."""
    edge_count: int
    classes: list[tuple[int, ...]]
    """Classes whose members are not all equivalent in the other, likewise."""
    class_count: int


class TickDifference(msgspec.Struct, frozen=True, kw_only=True):
    """What differs between a tick here and a tick there."""

    tick: int
    then: int
    """The tick there."""
    sensors: int
    """How many sensors both have, by name."""
    only_sensors: tuple[list[str], list[str]]
    """Those that only this and only the other has."""
    felt: list[Felt] | None
    """The sensors that differ; None: a state is not recorded."""
    actions: tuple[str | None, str | None]
    """What was decided."""
    height: tuple[int, int]
    edges: tuple[int, int]
    """The covering edges that are drawn, of all sensors."""
    here: Only
    there: Only


def difference(here: RunView, tick: int, there: RunView, then: int) -> TickDifference:
    """Return what differs between two ticks.

    Args:
        here: The one recording.
        tick: The tick in it.
        there: The other recording; may be the same.
        then: The tick in that.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: An observation or a key-frame that is needed is not there.
    """
    one = here.learned(tick)
    other = there.learned(then)
    drawn, their_drawn = here.graph(tick), there.graph(then)
    own = one.body.sensors[: one.body.size]
    its = other.body.sensors[: other.body.size]
    theirs = {name: sensor for sensor, name in enumerate(its)}
    common = [sensor for sensor, name in enumerate(own) if name in theirs]
    places = literals_of(common)
    graphs = (
        restricted(one.snapshot.poc_graph(), places),
        restricted(
            other.snapshot.poc_graph(),
            literals_of([theirs[own[sensor]] for sensor in common]),
        ),
    )
    frames = here.frames(tick, tick), there.frames(then, then)
    felt = None
    if all(frames):
        pairs = [(sensor, theirs[own[sensor]], own[sensor]) for sensor in common]
        felt = _felt(frames[0][0], frames[1][0], pairs)
    return TickDifference(
        tick=tick,
        then=then,
        sensors=len(common),
        only_sensors=(
            [name for name in own if name not in theirs],
            [name for name in its if name not in own],
        ),
        felt=felt,
        actions=(_action(frames[0]), _action(frames[1])),
        height=(drawn.height, their_drawn.height),
        edges=(len(drawn.edges), len(their_drawn.edges)),
        here=_only(graphs[0], graphs[1], places.tolist()),
        there=_only(graphs[1], graphs[0], places.tolist()),
    )


def _action(frames: list[Frame]) -> str | None:
    return frames[0].action if frames else None


def _felt(frame: Frame, other: Frame, pairs: list[tuple[int, int, str]]) -> list[Felt]:
    """Return the sensors that differ; each with its numbers here and there."""
    against = set(frame.contradicted), set(other.contradicted)
    felt = (
        Felt(
            sensor=one,
            name=name,
            reads=(frame.bits[one], other.bits[its]),
            state=(frame.state[one], other.state[its]),
            contradicted=(one in against[0], its in against[1]),
        )
        for one, its, name in pairs
    )
    return [
        each
        for each in felt
        if any(
            here != there for here, there in (each.reads, each.state, each.contradicted)
        )
    ]


def _only(graph: PocGraph, other: PocGraph, places: list[int]) -> Only:
    edges, classes = only_in(graph, other), only_equal(graph, other)
    return Only(
        edges=[
            Arrow(
                source=places[a],
                target=places[b],
                kind="inhibit" if b & 1 else "excite",
            )
            for a, b in edges[:MOST]
        ],
        edge_count=len(edges),
        classes=[tuple(places[a] for a in members) for members in classes[:MOST]],
        class_count=len(classes),
    )
