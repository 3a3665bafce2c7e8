"""The difference of two ticks equals a direct comparison of frames and orders."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from neurosnap.agent.body import Body
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import (
    difference,
    literals_of,
    only_in,
    restricted,
)
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from tests.golden.drive import drive, record
from tests.support.recorded_runs import csv_run, recorded, scripted_run, torn_run
from tests.support.scripted_sources import Scripted
from tests.support.strategies import graphs

TICKS = 60
BITS = (False, True)


def test_what_differs_at_a_tick_is_named(tmp_path: Path) -> None:
    run = csv_run(tmp_path / "rows.csv", TICKS)
    here, there = (
        RunView(recorded(options, tmp_path / f"{name}.mcap"))
        for name, options in {"a": run, "b": replace(run, threshold=0.02)}.items()
    )
    learned = here.learned(TICKS).snapshot.poc_graph()
    found = difference(here, TICKS, here, 0)
    assert found.felt is None  # nothing is believed before the first tick
    assert all(learned.leq(each.source, each.target) for each in found.here.edges)
    assert difference(here, 20, here, 20).here.count == 0
    for tick in (5, 25, 60):
        found = difference(here, tick, there, tick)
        one, other = here.frames(tick, tick)[0], there.frames(tick, tick)[0]
        assert found.felt is not None
        assert [each.sensor for each in found.felt] == [
            sensor
            for sensor in range(3)
            if (one.bits[sensor], one.state[sensor])
            != (other.bits[sensor], other.state[sensor])
        ]
        assert found.height == (one.height, other.height)


def test_what_is_contradicted_differs_from_what_is_unknown(tmp_path: Path) -> None:
    torn = RunView(torn_run(tmp_path / "torn.mcap"))
    # Nothing is learned of s1 but that it is independent.
    rows: list[list[bool | None]] = [[a, b, False] for a in BITS for b in BITS]
    blind = RunView(scripted_run([*rows, [True, None, None]], tmp_path / "blind.mcap"))
    felt = {
        each.sensor: each
        for each in difference(torn, torn.last, blind, blind.last).felt or ()
    }
    # Neither run reads s1, and neither state has anything of it.
    assert (felt[1].reads, felt[1].state) == ((None, None), (None, None))
    assert felt[1].contradicted == (True, False)


ROWS = [(True, False, False), (True, True, False), (False, True, True)]
"""What the sensors a, b and c read at three ticks."""


def view_of(log: Path, names: str, order: Sequence[int]) -> RunView:
    """Return a recorded run of `ROWS`, its columns in some order."""
    options = RunOptions(source="scripted", body=Body(own=tuple(names)), ticks=3)
    source = Scripted([[row[column] for column in order] for row in ROWS])
    record(drive(options, source), options, log)
    return RunView(log)


def test_runs_that_order_their_sensors_differently_are_compared_by_name(
    tmp_path: Path,
) -> None:
    here = view_of(tmp_path / "here.mcap", "abc", (0, 1, 2))
    there = view_of(tmp_path / "there.mcap", "cab", (2, 0, 1))
    for tick in (1, 2, 3):
        assert difference(here, tick, there, tick).felt == []
    found = difference(here, 3, there, 1)
    felt = found.felt or []
    assert [(one.sensor, one.name, one.reads) for one in felt] == [
        (0, "a", (0, 1)),
        (1, "b", (1, 0)),
        (2, "c", (1, 0)),
    ]
    # One sensor is as it was: that names are compared shows in the state, too.
    (one, other) = difference(here, 2, there, 3).felt or []
    assert (one.name, one.state, one.reads) == ("a", (1, 0), (1, 0))
    assert (other.name, other.state, other.reads) == ("c", (0, 1), (0, 1))


# What one order implies and another does not ------------------------------------------


@st.composite
def pairs_of_graphs(draw: st.DrawFn) -> tuple[PocGraph, PocGraph]:
    one, other = draw(graphs()), draw(graphs())
    least = min(len(one), len(other)) // 2
    own = literals_of(range(least))
    return restricted(one, own), restricted(other, own)


def is_equal(graph: PocGraph, a: int, b: int) -> bool:
    return graph.leq(a, b) and graph.leq(b, a)


@given(pairs_of_graphs())
def test_what_only_one_implies_is_found_and_nothing_else(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    literals = range(len(one))
    covers = {
        (a, b)
        for a in literals
        for b in literals
        if one.leq(a, b)
        and not one.leq(b, a)
        and one.representative[a] == a
        and one.representative[b] == b
        and not any(
            one.leq(a, c) and one.leq(c, b)
            for c in literals
            if not is_equal(one, a, c) and not is_equal(one, c, b)
        )
    }
    expected = {(a, b) for a, b in covers if not other.leq(a, b) and a <= b ^ 1}
    edges = only_in(one, other, [*literals]).edges
    found = [(each.source, each.target) for each in edges]
    assert len(found) == len(set(found))
    assert set(found) == expected


@given(pairs_of_graphs())
def test_orders_are_the_same_where_nothing_differs(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    own = [*range(len(one))]
    differs = any(only_in(*two, own).count for two in (pair, pair[::-1]))
    assert np.array_equal(one.closed, other.closed) is not differs
