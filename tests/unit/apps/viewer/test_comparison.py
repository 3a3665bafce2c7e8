"""Two recordings side by side, against frames and orders looked at one by one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from neurosnap.agent.body import Body
from neurosnap.apps.viewer.comparison import (
    Parted,
    Partings,
    SideBySide,
    difference,
    literals_of,
    only_equal,
    only_in,
    restricted,
)
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from tests.golden.drive import drive, record
from tests.support.recorded_runs import (
    csv_run,
    path_run,
    recorded,
    scripted_run,
    torn_run,
    without_states,
)
from tests.support.scripted_sources import Scripted
from tests.support.strategies import graphs

TICKS = 60
BITS = (False, True)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("partings")
    run = csv_run(folder / "rows.csv", TICKS)
    cautious = replace(run, threshold=0.02)
    shorter = replace(run, ticks=TICKS - 20)
    runs = {
        "run": run,
        "again": run,
        "cautious": cautious,
        "shorter": shorter,
        "path": path_run(TICKS),
        "path seeded": path_run(TICKS, seed=7),
    }
    found = {
        name: recorded(options, folder / f"{name}.mcap")
        for name, options in runs.items()
    }
    missing = range(10, 20)
    found["gaps"] = without_states(found["run"], folder / "gaps.mcap", missing)
    return found


def compared(logs: dict[str, Path], here: str, there: str) -> Partings:
    pair = SideBySide(RunView(logs[here]), RunView(logs[there]))
    while not (found := pair.read_on(0)).done:
        assert found.read_to < found.last
    return found


@pytest.mark.parametrize(
    ("here", "there"),
    [("run", "cautious"), ("run", "shorter"), ("path", "path seeded"), ("run", "gaps")],
)
def test_they_part_where_frames_and_orders_do(
    logs: dict[str, Path], here: str, there: str
) -> None:
    found = compared(logs, here, there)
    assert found.states is not None
    assert found.readings is not None
    assert found.orders is not None
    views = RunView(logs[here]), RunView(logs[there])
    last = min(view.last for view in views)
    frames = [{f.tick: f for f in view.frames(1, last)} for view in views]
    assert (found.first, found.last, found.read_to) == (1, last, last)
    both = [tick for tick in frames[0] if tick in frames[1]]
    pairs = [(tick, frames[0][tick], frames[1][tick]) for tick in both]
    felt = [tick for tick, one, other in pairs if one.bits != other.bits]
    held = [tick for tick, one, other in pairs if one.state != other.state]
    assert found.states.tick == min(held, default=None)
    assert (found.states.differing, found.states.compared) == (len(held), len(both))
    assert found.readings.tick == min(felt, default=None)
    if there != "gaps":  # readings are there where a state is not
        assert found.readings.differing == len(felt)
    else:
        assert (found.readings.compared, len(both)) == (last, last - 10)
    graphs = [
        [view.snapshot(t).poc_graph() for t in range(1, last + 1)] for view in views
    ]
    parted = [
        tick
        for tick, one, other in zip(range(1, last + 1), *graphs, strict=True)
        if not np.array_equal(one.closed, other.closed)
    ]
    assert found.orders.tick == min(parted, default=None)


def test_the_same_run_parts_nowhere(logs: dict[str, Path]) -> None:
    found = compared(logs, "run", "again")
    same = Parted(tick=None, differing=0, compared=TICKS)
    assert found.readings == found.states == same
    assert found.orders == replace(same, differing=None)
    assert found.decisions is None  # rows of a file decide nothing
    assert (found.sensors, found.only_here, found.only_there) == (3, [], [])


def test_decisions_are_compared_by_name(logs: dict[str, Path]) -> None:
    found = compared(logs, "path", "path seeded")
    views = RunView(logs["path"]), RunView(logs["path seeded"])
    did = [{f.tick: f.action for f in view.frames(1, TICKS - 1)} for view in views]
    differing = [tick for tick in did[0] if did[0][tick] != did[1][tick]]
    assert differing
    assert found.decisions is not None
    assert found.decisions.tick == differing[0]
    assert found.decisions.differing == len(differing)


def test_runs_of_other_sensors_have_none_in_common(logs: dict[str, Path]) -> None:
    found = compared(logs, "run", "path")
    assert (found.sensors, found.only_here) == (0, ["a", "b", "c"])
    assert found.only_there[0] == "below_1"
    assert found.readings is found.states is found.orders is None
    assert found.decisions is None  # one of the two has no actions


def test_what_differs_at_a_tick_is_named(logs: dict[str, Path]) -> None:
    here, there = RunView(logs["run"]), RunView(logs["cautious"])
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
    found = only_in(one, other)
    assert len(found) == len(set(found))
    assert set(found) == expected


@given(pairs_of_graphs())
def test_orders_are_the_same_where_nothing_differs(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    differs = any(only_in(*two) or only_equal(*two) for two in (pair, pair[::-1]))
    assert np.array_equal(one.closed, other.closed) is not differs


def test_a_chain_that_lost_its_middle() -> None:
    whole = PocGraph.from_implications(3, [(0, 2), (2, 4)])
    part = PocGraph.from_implications(3, [(0, 4)])
    assert only_in(whole, part) == [(0, 2), (2, 4)]
    assert only_in(part, whole) == []
    assert np.array_equal(literals_of([2, 0]), [4, 5, 0, 1])
