"""Two recordings side by side, against frames and orders looked at one by one."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from neurosnap.apps.viewer.order_difference import is_same
from neurosnap.apps.viewer.partings import Partings, SideBySide
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import difference
from tests.support.recorded_runs import (
    csv_run,
    path_run,
    recorded,
    scripted_run,
    torn_run,
    without_states,
)

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
        if not is_same(one, other)
    ]
    assert found.orders.tick == min(parted, default=None)


def test_the_same_run_parts_nowhere(logs: dict[str, Path]) -> None:
    found = compared(logs, "run", "again")
    for one in (found.readings, found.decisions, found.states, found.orders):
        assert one.tick is None
    assert (found.readings.compared, found.orders.compared) == (TICKS, TICKS)
    assert (found.sensors, found.only_here, found.only_there) == (3, [], [])


def test_decisions_are_compared_by_name(logs: dict[str, Path]) -> None:
    found = compared(logs, "path", "path seeded")
    views = RunView(logs["path"]), RunView(logs["path seeded"])
    did = [{f.tick: f.action for f in view.frames(1, TICKS - 1)} for view in views]
    differing = [tick for tick in did[0] if did[0][tick] != did[1][tick]]
    assert differing
    assert found.decisions.tick == differing[0]
    assert found.decisions.differing == len(differing)


def test_runs_of_other_sensors_have_none_in_common(logs: dict[str, Path]) -> None:
    found = compared(logs, "run", "path")
    assert (found.sensors, found.only_here) == (0, ["a", "b", "c"])
    assert found.only_there[0] == "below_1"
    assert found.orders.tick is None


def test_two_ticks_of_one_run_differ_in_what_was_learned(logs: dict[str, Path]) -> None:
    view = RunView(logs["run"])
    found = difference(view, TICKS, view, 0)
    assert found.felt is None  # nothing is believed before the first tick
    assert found.sensors == 3
    learned = view.snapshot(TICKS).poc_graph()
    edges = {(each.source, each.target) for each in found.here.edges}
    assert all(learned.leq(a, b) for a, b in edges)
    nothing = difference(view, 20, view, 20)
    assert nothing.felt == []
    assert (nothing.here.edge_count, nothing.there.edge_count) == (0, 0)
    assert (nothing.here.classes, nothing.there.classes) == ([], [])


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
