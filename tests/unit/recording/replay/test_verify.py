"""Replay of a run with unknown readings and refused reports."""

from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.recorded_messages import assert_true_run
from tests.support.rewritten_recordings import changing, rewritten, saying, write_again
from tests.support.scripted_sources import Scripted

TICKS = 20


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which every sensor is read."""
    source = Scripted(implying_rows(2 * TICKS, 0), ACTIONS)
    log = tmp_path_factory.mktemp("whole") / "log.mcap"
    return record_scripted(source, scripted_options(TICKS), log)


@pytest.mark.parametrize("sensor", [2, 3, 5])
def test_a_reading_said_to_be_unknown_that_is_known_is_found(
    whole: Path, log: Path, sensor: int
) -> None:
    """An own one shows in what is learned, a made one in what it is made of."""
    names = scripted_options(TICKS).sensors
    mask = ((1 << len(names)) - 1) ^ (1 << sensor)

    def unread(message: wire.Observation) -> dict[str, object]:
        size = len(message.bits)
        bits = int.from_bytes(message.bits, "little") & mask
        return {
            "bits": bits.to_bytes(size, "little"),
            "known": mask.to_bytes(size, "little"),
        }

    change = changing(wire.Observation, lambda one: one.tick == 9, unread)
    difference = str(verify(rewritten(whole, log, change)).difference)
    assert difference.startswith("tick 9: /")
    if sensor >= 3:
        assert f"/observation: {names[sensor]} does not follow" in difference


def test_what_was_refused_of_a_wave_that_settled_is_refused_again(
    whole: Path, log: Path
) -> None:
    recording, said = Recording.open(whole), []
    expected = dict(recording.noted().expected)
    for one in recording.messages():
        if isinstance(one.message, wire.CellReport) and one.message.cell == 1:
            wrong = saying(one, literals=(2, 3), hops=(0, 0), epoch=10**6)
            said.append(wrong._replace(sequence=expected["cell/1"]))
            expected["cell/1"] += 1
        said.append(one)
    verdict = assert_true_run(write_again(recording, log, said, expected=expected))
    assert verdict.states == TICKS


def test_a_key_frame_follows_many_waves_and_a_replay_begins_at_each(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("neurosnap.protocol.coordinator.MOST_WAVES", 14)
    source = Scripted(implying_rows(2 * TICKS, 0), ACTIONS)
    record_scripted(source, scripted_options(2 * TICKS, keyframe_every=13), log)
    frames = Recording.open(log).all("keyframe", wire.KeyFrame)
    ticks = [frame.tick for frame in frames]
    assert ticks == [7, 13, 20, 26, 33, 39, 40]
    for tick in ticks[:-1]:
        assert_true_run(log, tick, ticks=40 - tick)
