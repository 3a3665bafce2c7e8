"""The learned order by name."""

from pathlib import Path

import numpy as np
import pytest

from neurosnap.apps.export.learned import diagram, learned_from
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import Sensorium
from tests.support.lamp import BIRTH, GROWN, lamp_options
from tests.support.recorded_runs import recorded


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


def test_what_is_grown_is_in_the_order_from_its_birth_on(tmp_path: Path) -> None:
    options = lamp_options(ticks=40, cells="inline")
    recording = Recording.open(recorded(options, tmp_path / "lamp.mcap"))
    for at, sensors in ((BIRTH - 1, 24), (BIRTH, 25)):
        learned = learned_from("lamp", recording, at=at)
        assert f" of {sensors} sensors in {at} ticks" in learned.title
        assert learned.snapshot is not None
        order = learned.order(learned.snapshot)
        assert (len(order.sensors), order.room) == (sensors, 27 - sensors)
        born = [(each.tick, each.name) for each in order.births]
        assert born == [(BIRTH, GROWN)] * (sensors - 24)
