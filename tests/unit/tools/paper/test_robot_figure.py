"""The figure of the robot's faults counts what it says it counts."""

import numpy as np
import pytest

from tools.paper import fig9_robot as figure
from tools.paper.figure import FigureOptions
from tools.paper.robot_faults import CASES, METHODS, Seen, _Outliers, observed, trailing
from world.robot import Robot, RobotFault
from world.robot_world import SENSOR_TOPICS, near, sensed


def test_what_is_observed_is_what_the_robot_senses() -> None:
    robot = Robot(3)
    seen = observed(robot, 2)
    assert (seen.bits.shape, bool(seen.known.all())) == ((600, 31), True)
    again, rows = Robot(3), []
    for number in range(1200):
        again.step()
        if number % 2 == 0:
            rows.append(sensed(again, near(again.scan()).tolist()))
    differ = (np.array(rows) != seen.bits).mean(0)
    scan = np.array([topic == "/scan" for topic in SENSOR_TOPICS.values()])
    assert not differ[~scan].any()
    assert differ[scan].max() < 0.03  # the noise of the ranges is another one


@pytest.mark.parametrize(("kind", "what"), [("frozen", "scan"), ("silent", "/scan")])
def test_a_scan_that_fails_changes_no_more(kind: str, what: str) -> None:
    robot = Robot(3, RobotFault(kind, 0, what))  # type: ignore[arg-type]
    seen: Seen = observed(robot, 2)
    scan = np.array([topic == "/scan" for topic in SENSOR_TOPICS.values()])
    assert (seen.bits[:, scan] == seen.bits[0, scan]).all()
    assert seen.known[scan].any() == (kind == "frozen")
    assert seen.known[~scan].all()


@pytest.mark.parametrize("name", METHODS[3::2])
def test_the_common_methods_score_each_minute(name: str) -> None:
    robot = Robot(3)
    method = _Outliers(observed(robot, 30), name)
    scores = method.scores(observed(robot, 5))
    assert scores.shape == (5,)
    assert np.isfinite(scores).all()


def test_means_trail() -> None:
    rows = np.array([[1.0], [3.0], [5.0]])
    np.testing.assert_allclose(trailing(rows, 2), [[1], [2], [4]])


def scores(robots: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return made-up scores of robots, the first four of which are chosen by."""
    forest, network = METHODS.index("isolation forest, 1 min"), len(METHODS) - 1
    made = np.full((robots, len(CASES), len(METHODS), 2880), np.nan)
    made[:, 0] = made[:, 1:, :, :180] = 0.0
    made[:, :, forest, 100] = 1.0  # as often, whatever is wrong
    made[:, 0, network, 100] = 1.0
    made[4:, 0, network, 100] = 1.5  # what those that are chosen by do not say
    made[:, 1, network, 5:180] = 2.0
    made[:, 0, 0, [9, 9 + 1440]] = 3.0  # alarms of three sensors, twice
    made[:, 2, 0, 9] = made[:, 3, 0, 39] = 1.0  # as without the fault; by the fault
    return made


def test_rules_are_chosen_by_some_robots_and_judged_on_the_others() -> None:
    report = figure.report(FigureOptions(runs=2), list(scores(6)[:, None]))
    found = {tuple(row[:3]): float(str(row[3])) for row in report.rows}

    def of(measure: str, method: str, *faults: str) -> list[float]:
        return [found[fault, method, measure] for fault in faults]

    assert of("alarms a week", "health", "none") == [6 / 2 * 7]
    assert of("recall", "health", "stuck_on", "stuck_off", "frozen") == [0, 0, 1]
    assert of("median minutes", "health", "frozen") == [40]
    assert of("precision", "health", "frozen") == [pytest.approx(8 / 9, abs=1e-6)]
    assert of("alarms a week", "isolation forest", "none") == [0]
    assert of("recall", "isolation forest", "all") == [0]
    assert of("alarms a week", "autoencoder", "none") == [3.5]
    assert of("recall", "autoencoder", "stuck_on", "stuck_off") == [1, 0]
    assert of("median minutes", "autoencoder", "stuck_on") == [6]
