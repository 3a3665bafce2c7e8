"""What differs between two ticks, by the names of sensors and not by their numbers."""

from collections.abc import Sequence
from pathlib import Path

from neurosnap.agent.body import Body
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import difference
from neurosnap.protocol.run_options import RunOptions
from tests.golden.drive import drive, record
from tests.support.scripted_sources import Scripted

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
