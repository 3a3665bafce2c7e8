"""The alarms that a monitor raised in a home, each with its end."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

from neurosnap.apps import health_log
from neurosnap.health.alarm import Alarm, AlarmProgress, News, told
from neurosnap.recording.read.observations import OwnReadings


def alarm(kind: str, step: int) -> News:
    """Return that an alarm was raised after a step."""
    found = Alarm("door", kind, step - 3, step, 9.0, 1.0, 0.01, 0, 2.5, 0, None)
    return News(step + 1, "door", found)


class Scripted:
    """A follower that says what it is told to, whatever it observes."""

    def __init__(self, names: Sequence[str], said: list[list[News]]) -> None:
        self._said = iter(said)
        progress = AlarmProgress(0, 0, 0, len(names))
        self.monitor = SimpleNamespace(sensors=[], progress=progress)

    def observe(self, *_: object, **__: object) -> list[News]:
        return next(self._said)


def log_of(
    said: list[list[News]], monkeypatch: pytest.MonkeyPatch
) -> health_log.HealthLog:
    monkeypatch.setattr(health_log, "Follower", lambda names, _: Scripted(names, said))
    off = np.zeros(1, np.bool_)
    observations = [OwnReadings(float(at), off, ~off) for at in range(len(said))]
    return health_log.follow(observations, ["door"], "1/week")


def test_an_alarm_that_becomes_another_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    less, silent = alarm("less", 10), alarm("silent", 20)
    found = log_of([[less], [silent]], monkeypatch)
    ends = [(each.ended, each.became) for each in found.alarms]
    assert ends == [(told(21), "silent"), (None, None)]
    lines = list(found.lines())
    assert lines[0].endswith(f" Became 'silent' {told(21)}.")
    assert lines[-1] == "2 alarms, 1 in force (budget 1/week)"


SILENT, STUCK = alarm("silent", 10), alarm("stuck", 40)
OVER = News(31, "door", None)


@pytest.mark.parametrize(
    "said",
    [
        [[SILENT], [OVER], [STUCK]],
        [[SILENT, OVER, STUCK]],
        [[SILENT], [OVER, alarm("stuck", 30)]],
    ],
    ids=["step by step", "several steps at once", "an end and an alarm in one step"],
)
def test_an_alarm_ends_before_a_later_one_begins(
    said: list[list[News]], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = log_of(said, monkeypatch)
    ends = [(each.ended, each.became) for each in found.alarms]
    assert ends == [(told(31), None), (None, None)]
