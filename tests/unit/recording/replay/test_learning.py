from itertools import combinations
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import RecordingError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.learning import Learning

LOG = Path("run.mcap")


def options(sensors: int = 3) -> RunOptions:
    names = tuple(f"s{number}" for number in range(sensors))
    return RunOptions(source="readings.csv", body=Body(own=names))


def observed(*ticks: int) -> list[wire.Observation]:
    """Return readings of three sensors, which change from tick to tick."""
    return [wire.Observation(tick, bytes((tick % 8,))) for tick in ticks]


def learned(last: int) -> Learning:
    learning = Learning(LOG, options())
    assert list(learning.learn_to(last, observed(*range(1, last + 1)), {})) == [
        *range(1, last + 1)
    ]
    return learning


def test_a_copy_stays_where_it_was() -> None:
    learning = learned(10)
    other = learning.copy()
    before = other.snapshot.to_bytes()
    learning.learn(observed(11)[0])
    assert (other.tick, other.snapshot.to_bytes()) == (10, before)


@pytest.mark.parametrize("ticks", [(1, 2, 4), (1, 2)])
def test_an_observation_that_is_missing_is_an_error(ticks: tuple[int, ...]) -> None:
    learning = Learning(LOG, options())
    rule = r"^run\.mcap: must hold the observation of tick 3, got none$"
    with pytest.raises(RecordingError, match=rule):
        list(learning.learn_to(4, observed(*ticks), {}))
    assert learning.tick == 2


def test_an_observation_of_other_sensors_is_an_error() -> None:
    learning = Learning(LOG, options(20))
    with pytest.raises(RecordingError, match=r"^run\.mcap: tick 1: /observation: "):
        learning.learn(observed(1)[0])


def test_a_key_frame_of_another_run_is_an_error() -> None:
    learning = Learning(LOG, options())
    other = options(4).new_snapshot().to_bytes()
    for snapshot, rule in ((other, "of the run's sensors, got 4"), (b"", "a snapshot")):
        with pytest.raises(RecordingError, match=rf"key-frame of tick 7: .*{rule}"):
            learning.restore(wire.KeyFrame(7, snapshot))
    assert learning.tick == 0


def test_what_is_paused_is_not_learned() -> None:
    plain, paused = learned(10), learned(10)
    for observation in observed(11, 12):
        paused.learn(msgspec.structs.replace(observation, paused=True))
    assert paused.tick == 12
    assert paused.snapshot.clock == 10
    for a, b in combinations(range(0, 6, 2), 2):
        assert paused.snapshot.evidence(a, b) == plain.snapshot.evidence(a, b)
    again = Snapshot.from_bytes(paused.snapshot.to_bytes())
    for tick in range(13, 60):
        for learning in (paused.snapshot, again):
            learning.learn([tick % 2, tick % 2, tick % 3 == 0])
    assert again.to_bytes() == paused.snapshot.to_bytes()


def test_since_when_something_is_believed_is_a_tick() -> None:
    plain, paused = learned(10), Learning(LOG, options())
    for observation in observed(1, 2, 3):
        paused.learn(msgspec.structs.replace(observation, paused=True))
    for observation in observed(*range(1, 11)):
        later = msgspec.structs.replace(observation, tick=observation.tick + 3)
        paused.learn(later)
    for a, b in combinations(range(0, 6, 2), 2):
        since = plain.snapshot.evidence(a, b).since
        assert paused.snapshot.evidence(a, b).since == since + 3
