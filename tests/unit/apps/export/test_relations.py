"""What a run has learned, as a table."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from neurosnap.apps.export.relations import csv_of, learned_from
from neurosnap.poc.learning.beyond_pairs import Limits
from neurosnap.recording.read.recording import Recording
from neurosnap.sources.open_readings import open_readings
from tests.support.lamp import BIRTH, lamp_options
from tests.support.recorded_runs import recorded


def test_what_is_grown_is_in_the_table_from_its_birth_on(tmp_path: Path) -> None:
    options = lamp_options(ticks=40, cells="inline")
    recording = Recording.open(recorded(options, tmp_path / "lamp.mcap"))
    for at, sensors in ((BIRTH - 1, 24), (BIRTH, 25)):
        learned = learned_from("lamp", recording, at=at)
        assert f" of {sensors} sensors in {at} ticks" in learned.title


@pytest.mark.parametrize(
    ("moment", "said"),
    [
        (lambda row: f"2026-01-01 00:{row // 60:02}:{row % 60:02}", "within 2 s"),
        # Rows that are not as far apart.
        (lambda row: str(row**2), "within 2 ticks"),
        (None, "within 2 ticks"),
    ],
)
def test_a_lag_is_told_in_seconds_where_rows_are_regular(
    tmp_path: Path, moment: Callable[[int], str] | None, said: str
) -> None:
    chance = np.random.default_rng(3)
    valve = np.repeat(chance.random(300) < 0.5, chance.integers(3, 20, 300))[:2400]
    flow = np.concatenate([valve[:2] & False, valve[:-2]])
    bits = zip(valve.astype(int), flow.astype(int), strict=True)
    clock = moment or (lambda _: "")
    rows = [{"time": clock(k), "valve": a, "flow": b} for k, (a, b) in enumerate(bits)]
    if moment is None:
        rows = [{k: row[k] for k in ("valve", "flow")} for row in rows]
    path = tmp_path / "tank.csv"
    path.write_text(csv_of([*rows[0]], rows))
    learned = learned_from("tank", open_readings(str(path)))
    told = {learned.cells(row)[0] for row in learned.rows}
    assert [line for line in told if line.startswith(f"valve implies flow {said} (")]
    alone = learned_from("tank", open_readings(str(path)), limits=Limits(1, 0))
    assert not [row for row in alone.rows if row.within or row.premises > 1]
    assert learned.facts()["left"] == 0
