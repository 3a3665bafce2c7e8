"""What a run has learned, as a table."""

from pathlib import Path

from neurosnap.apps.export.relations import learned_from
from neurosnap.recording.read.recording import Recording
from tests.support.lamp import BIRTH, lamp_options
from tests.support.recorded_runs import recorded


def test_what_is_grown_is_in_the_table_from_its_birth_on(tmp_path: Path) -> None:
    options = lamp_options(ticks=40, cells="inline")
    recording = Recording.open(recorded(options, tmp_path / "lamp.mcap"))
    for at, sensors in ((BIRTH - 1, 24), (BIRTH, 25)):
        learned = learned_from("lamp", recording, at=at)
        assert f" of {sensors} sensors in {at} ticks" in learned.title
