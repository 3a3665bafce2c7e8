from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.learn_again import Learning

LOG = Path("run.mcap")


def options(sensors: int = 3) -> RunOptions:
    names = tuple(f"s{number}" for number in range(sensors))
    return RunOptions(source="readings.csv", body=Body(own=names))


def test_an_observation_of_other_sensors_is_an_error() -> None:
    learning = Learning(LOG, options(20))
    with pytest.raises(RecordingError, match=r"^run\.mcap: tick 1: /observation: "):
        learning.learn(wire.Observation(1, b"\1"))


def test_a_key_frame_of_another_run_is_an_error() -> None:
    learning = Learning(LOG, options())
    other = options(4).new_snapshot().to_bytes()
    for snapshot, rule in ((other, "of the run's sensors, got 4"), (b"", "a snapshot")):
        with pytest.raises(RecordingError, match=rf"key-frame of tick 7: .*{rule}"):
            learning.restore(wire.KeyFrame(7, snapshot))
    assert learning.tick == 0
