"""A run in several files goes on when a part of it dies, and comes to the same."""

from pathlib import Path

import msgspec
import pytest

from neurosnap.protocol.run_options import SMALLEST
from neurosnap.recording.read.recording import part_paths
from neurosnap.recording.replay.verify import verify
from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    check_same,
    options_for,
)

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


def test_a_run_in_several_files_comes_to_the_same(tmp_path: Path) -> None:
    options = msgspec.structs.replace(
        options_for(ENDLESS), keyframe_every=50, split=SMALLEST
    )
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log, files=True)
    outcome = disturbed.run(
        *((60, (victim,)) for victim in ("recorder", "coordinator", "cell/2"))
    )
    check_same(outcome, disturbed, log, options, calm)
    files = part_paths(log)
    assert verify(log).files == len(files) > 2
    assert list(files) == list(range(len(files)))
    for path in list(files.values())[1:]:
        alone = verify(path)
        assert (alone.same, alone.complete) == (True, True)
    assert sorted(tmp_path.iterdir()) == sorted([calm, *files.values()])
