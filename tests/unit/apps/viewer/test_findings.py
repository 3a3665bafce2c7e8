"""Anomalies are grouped into findings, each with its start, its end and its state."""

import numpy as np
import pytest

from neurosnap.apps.viewer.api import AnomalyView
from neurosnap.apps.viewer.findings import NEAR, Spells

DOOR, MOTION = "read on, expected off", "read off, expected on"
"""What is said of the door, and of the motion that an open door has."""
READ = {"k": (1, 1), "b": (1, 0), "o": (0, 0), "u": (1, None)}
"""What door and motion read at a tick: the rule is kept, broken, kept, not known.
A capital is a tick with an anomaly, by which motion, the door or no rule is told."""
TOLD = {
    "M": AnomalyView(culprits=[1], others=[], sentence="", rule=(0, 2)),
    "D": AnomalyView(culprits=[0], others=[1], sentence="", rule=(0, 2)),
    "N": AnomalyView(culprits=[1], others=[], sentence="", rule=None),
}
FAR = NEAR * "k"
CASES = {
    "nothing was told": ("kbk", []),
    "its rule is kept again": ("kMo", [(2, 2, "over", MOTION)]),
    "nothing came after it": ("kM", [(2, 2, "now", MOTION)]),
    "it goes on untold": ("MMbk", [(1, 2, "learned as normal", MOTION)]),
    "what is not read says nothing": ("Muuk", [(1, 1, "over", MOTION)]),
    "no rule is told": ("Nk", [(1, 1, "over", "may be wrong")]),
    "near": (f"M{FAR[1:]}M", [(1, 1 + NEAR, "now", MOTION)]),
    "far": (
        f"M{FAR}Mo",
        [(1, 1, "over", MOTION), (2 + NEAR, 2 + NEAR, "over", MOTION)],
    ),
    "another": ("MDo", [(1, 1, "learned as normal", MOTION), (2, 2, "over", DOOR)]),
}


@pytest.mark.parametrize(("run", "found"), CASES.values(), ids=CASES)
def test_what_is_told_of_one_sensor_is_one_finding(
    run: str, found: list[tuple[int, int, str, str]]
) -> None:
    spells = Spells()
    for tick, what in enumerate(run, 1):
        row = READ.get(what, READ["b"])
        read = np.array([bit is on for bit in row for on in (1, 0)])
        spells.take(tick, TOLD.get(what), read)
    listed = spells.listed
    assert [(one.first, one.last, one.state, one.what) for one in listed] == found
    for one in listed:
        assert one.tick == one.first
        pair = [0, 1] if one.what == DOOR else [1, 0] if one.what == MOTION else [1]
        assert one.sensors == pair
