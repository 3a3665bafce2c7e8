"""The differences between two ticks, of one recording or of two.

Compared are readings, decisions, believed states and learned orders, of the sensors
that both have, by their names.
"""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.viewer.api import Arrow, Bit, Frame
from neurosnap.apps.viewer.learned_by_tick import classes, covers
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import from_words
from neurosnap.recording.replay.learn_again import Learning

_LISTED = 50
"""Edges and classes that are listed."""


class Felt(msgspec.Struct, frozen=True, kw_only=True):
    """A sensor that differs between two ticks, with both values of each field."""

    sensor: int
    """Its number here."""
    name: str
    reads: tuple[Bit, Bit]
    state: tuple[Bit, Bit]
    contradicted: tuple[bool, bool]


class Only(msgspec.Struct, frozen=True, kw_only=True):
    """The implications of one order that the other lacks."""

    edges: list[Arrow]
    """Covering edges, the first `_LISTED` of them."""
    classes: list[tuple[int, ...]]
    """Classes of equivalent literals, likewise."""
    count: int
    """How many edges and classes there are."""


class TickDifference(msgspec.Struct, frozen=True, kw_only=True):
    """All differences between one tick and another."""

    tick: int
    then: int
    """The tick there."""
    sensors: int
    """How many sensors both have, by name."""
    felt: list[Felt] | None
    """The sensors that differ; None if a state is not recorded."""
    actions: tuple[str | None, str | None]
    """What was decided."""
    height: tuple[int, int]
    edges: tuple[int, int]
    """The covering edges that are drawn, of all sensors."""
    here: Only
    there: Only


def difference(here: RunView, tick: int, there: RunView, then: int) -> TickDifference:
    """Return the differences between two ticks.

    Args:
        here: The one recording.
        tick: The tick in it.
        there: The other recording; may be the same.
        then: The tick in that.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: An observation or a key-frame that is needed is not there.
    """
    frames = here.frames(tick, tick), there.frames(then, then)
    mine, its = (found[0] if found else None for found in frames)
    return compared(here.learned(tick), mine, there.learned(then), its)


def compared(
    one: Learning, mine: Frame | None, other: Learning, its: Frame | None
) -> TickDifference:
    """Return what differs between two ticks: what was learned by them, their frames."""
    graph, their_graph = one.snapshot.poc_graph(), other.snapshot.poc_graph()
    own = one.body.sensors[: one.body.size]
    theirs = {name: k for k, name in enumerate(other.body.sensors[: other.body.size])}
    pairs = [(k, theirs[name], name) for k, name in enumerate(own) if name in theirs]
    places = literals_of([k for k, _, _ in pairs])
    order = restricted(graph, places)
    their_order = restricted(their_graph, literals_of([k for _, k, _ in pairs]))
    return TickDifference(
        tick=one.tick,
        then=other.tick,
        sensors=len(pairs),
        felt=_felt(mine, its, pairs) if mine and its else None,
        actions=(mine.action if mine else None, its.action if its else None),
        height=(graph.height(), their_graph.height()),
        edges=(len(covers(graph)), len(covers(their_graph))),
        here=only_in(order, their_order, places.tolist()),
        there=only_in(their_order, order, places.tolist()),
    )


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
        if any(a != b for a, b in (each.reads, each.state, each.contradicted))
    ]


def only_in(graph: PocGraph, other: PocGraph, places: list[int]) -> Only:
    """Return what one order implies and another does not.

    What is implied by way of others is no difference in edges, and what equivalent
    literals share is one in classes. O(N³/64) time where the orders are new.

    Args:
        graph: The one.
        other: Over the same sensors.
        places: The numbers that their literals have here.
    """
    edges = [(a, b) for a, b in covers(graph) if not other.leq(a, b)]
    standing = other.representative
    apart = [
        members
        for members in classes(graph)
        if len(set(standing[list(members)].tolist())) > 1
    ]
    return Only(
        edges=[Arrow(source=places[a], target=places[b]) for a, b in edges[:_LISTED]],
        classes=[tuple(places[a] for a in members) for members in apart[:_LISTED]],
        count=len(edges) + len(apart),
    )


def literals_of(sensors: Sequence[int]) -> NDArray[np.intp]:
    """Return the literals of some sensors: ``(2M,)``, each beside its complement."""
    own = 2 * np.asarray(sensors, np.intp)
    return np.stack([own, own + 1], axis=1).ravel()


def restricted(graph: PocGraph, literals: NDArray[np.intp]) -> PocGraph:
    """Return the order among some literals of a graph, in their order. O(N²) time.

    They are ``(2M,)``, each literal beside its complement.
    """
    if np.array_equal(literals, np.arange(len(graph))):
        return graph
    closed = from_words(graph.closed, len(graph))
    return PocGraph(closed[np.ix_(literals, literals)])
