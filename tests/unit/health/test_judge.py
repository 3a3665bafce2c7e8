"""When evidence against a sensor starts and ends, compared with counts by hand."""

import numpy as np
import pytest

from neurosnap.health.evidence import CHATTER, KINDS, LESS, MORE, SILENT, STUCK
from neurosnap.health.judge import WELL, Judge
from neurosnap.health.ten_minute_steps import DAY, STEP, WEEK

OFF, ON = np.zeros(1, np.int32), np.ones(1, np.int32)
VALID = np.ones(1, np.bool_)


def lasting(seconds: float) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    return np.array([seconds], np.float32)


def noted(judge: Judge, number: int, trace: float, on: bool, longest: float) -> None:
    """Let a judge take in evidence of all kinds."""
    traces = np.full((1, len(KINDS)), trace)
    judge._keep_evidence(traces, number, ON if on else OFF, lasting(longest), VALID)


def test_evidence_began_in_the_step_in_which_it_left_zero() -> None:
    judge = Judge(1, 1.0)
    begun = []
    for number, trace in enumerate((0.0, 1.0, 2.0, 0.0, 1.0), 100):
        noted(judge, number, trace, on=False, longest=0.0)
        begun.append(int(judge.since[0, LESS]))
    # At 101 it was zero before, at 103 it is zero again.
    assert begun == [100, 101, 101, 103, 104]


def test_a_silence_begins_after_the_last_step_with_an_activation() -> None:
    judge = Judge(1, 1.0)
    noted(judge, 100, 1.0, on=True, longest=60.0)
    noted(judge, 101, 1.0, on=False, longest=0.0)
    assert judge.since[0, SILENT] == 101


@pytest.mark.parametrize(
    ("longest", "since"), [(0.0, 100), (60.0, 100), (600.0, 100), (601.0, 99)]
)
def test_a_sensor_is_stuck_since_it_came_on(longest: float, since: int) -> None:
    judge = Judge(1, 1.0)
    assert STEP == 600
    noted(judge, 100, 1.0, on=False, longest=longest)
    assert (judge.since[0, STUCK], judge.since[0, CHATTER]) == (since, 100)


def ended(judge: Judge, number: int, strain: float) -> bool:
    """Return whether a sensor whose rate had changed is well again."""
    judge.strain[0, MORE] = strain
    return judge._end(number, ON, lasting(0.0), VALID) == [0]


def test_a_changed_rate_is_over_after_a_whole_day_of_calm() -> None:
    judge = Judge(1, 1.0)
    judge.kind[0], judge.raised_at[0] = MORE, 0
    for number in range(DAY - 1):
        assert not ended(judge, number, 0.4)
    assert not ended(judge, DAY, 0.5)  # not below a half: the day begins anew
    for number in range(DAY - 1):
        assert not ended(judge, DAY + number, 0.4)
    assert ended(judge, 2 * DAY, 0.4)
    assert judge.kind[0] == WELL


def test_calm_before_an_alarm_does_not_count() -> None:
    judge = Judge(1, 1.0)
    judge.calm[0], judge.strain[0, MORE] = DAY, 1.0
    assert judge._begin(None, 5) == [0]  # type: ignore[arg-type]
    assert (judge.calm[0], judge.raised_at[0]) == (0, 5)
    assert not ended(judge, 6, 0.4)


def test_a_silence_goes_on_while_an_alarm_of_another_kind_ends() -> None:
    judge = Judge(1, 1.0)
    judge.kind[0], judge.raised_at[0] = MORE, 0
    judge.clocks[:], judge.sums[:], judge.evidence[:] = 2.0, 3.0, 4.0
    assert judge._end(2 * WEEK, OFF, lasting(0.0), VALID) == [0]
    assert (judge.clocks == 2).all()
    assert (judge.sums == 0).all()
    assert judge.evidence[0].tolist() == [4.0, 0.0, 0.0, 0.0, 0.0]


def test_unknown_readings_are_no_calm_and_no_beginning() -> None:
    judge = Judge(1, 1.0)
    judge.kind[0], judge.calm[0] = MORE, DAY - 1
    assert judge._end(5, OFF, lasting(0.0), ~VALID) == []
    noted(judge, 100, 1.0, on=False, longest=0.0)
    traces = np.zeros((1, len(KINDS)))
    judge._keep_evidence(traces, 101, OFF, lasting(0.0), ~VALID)
    assert (judge.since[0, LESS], judge.evidence[0, LESS]) == (100, 1.0)


@pytest.mark.parametrize(("changed", "left"), [(2, 2), (3, 0), (4, 0)])
def test_where_the_rates_of_many_change_none_of_them_is_at_fault(
    changed: int, left: int
) -> None:
    judge = Judge(9, 1.0)
    judge.strain[:changed, MORE], judge.strain[8, SILENT] = 1.5, 1.5
    judge._excuse_many(9)
    assert (judge.strain[:, MORE] >= 1).sum() == left
    assert judge.strain[8, SILENT] == 1.5


def test_a_changed_rate_is_accepted_after_two_weeks() -> None:
    judge = Judge(1, 1.0)
    judge.kind[0], judge.raised_at[0] = MORE, 10
    assert not ended(judge, 10 + 2 * WEEK - 1, 1.0)
    assert ended(judge, 10 + 2 * WEEK, 1.0)
