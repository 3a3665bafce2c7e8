"""The simulated robot keeps to physics, and breaks as it is told and when."""

import copy
import itertools
import math
import runpy
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from neurosnap.errors import InvalidValueError
from neurosnap.sources.mcap_file import describe_mcap
from world.robot import (
    AFFECTED,
    RADIUS,
    STEP,
    TYPES,
    WHEELBASE,
    FaultKind,
    Robot,
    RobotFault,
    distances,
    furnished,
)
from world.robot_world import SENSOR_TOPICS, RobotTopics, RobotWorld, near

KINDS = tuple(AFFECTED)
RECORD = Path(__file__).parents[3] / "examples" / "robot" / "record.py"
EACH = [(kind, what) for kind in KINDS for what in AFFECTED[kind]]


def driven(seed: int, seconds: float, fault: RobotFault | None = None) -> Robot:
    robot = Robot(seed, fault)
    for _ in range(round(seconds / STEP)):
        robot.step()
    return robot


def broken(robot: Robot, kind: FaultKind, what: str, size: float = 0.5) -> Robot:
    """Return a copy of a robot that breaks with its next step."""
    other = copy.deepcopy(robot)
    other.fault = RobotFault(kind, robot.time + STEP, what, size)
    return other


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([None, *EACH]))
def test_it_stays_outside_of_walls_and_posts_and_its_charge_between_bounds(
    seed: int, broken_by: tuple[FaultKind, str] | None
) -> None:
    fault = RobotFault(broken_by[0], 20, broken_by[1], 0.4) if broken_by else None
    robot = Robot(seed, fault)
    room, before = robot.room, (robot.x, robot.y)
    for _ in range(2000):
        robot.step()
        assert RADIUS <= robot.x <= room.width - RADIUS
        assert RADIUS <= robot.y <= room.depth - RADIUS
        for x, y, radius in room.posts:
            assert math.dist((x, y), (robot.x, robot.y)) > radius + RADIUS - 1e-9
        assert 0 <= robot.readings["battery"] <= 1
        assert math.dist(before, (robot.x, robot.y)) < 0.03
        before = robot.x, robot.y


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.floats(-4, 4), st.floats(0.2, 0.8))
def test_each_ray_ends_at_the_first_thing_in_its_way(
    seed: int, heading: float, along: float
) -> None:
    room = furnished(np.random.default_rng(seed))
    x, y = room.width * along, room.depth / 2
    if any(math.dist((x, y), post[:2]) < post[2] for post in room.posts):
        return
    angles = heading + 2 * math.pi * np.arange(64) / 64
    for angle, far in zip(angles, distances(room, x, y, heading), strict=True):

        def gap(at: float, angle: float = angle) -> float:
            px, py = x + at * math.cos(angle), y + at * math.sin(angle)
            walls = px, room.width - px, py, room.depth - py
            posts = [math.dist((px, py), p[:2]) - p[2] for p in room.posts]
            return min(*walls, *posts)

        assert abs(gap(far)) < 1e-6
        assert all(gap(at) > 0 for at in np.linspace(0, far - 1e-3, 9))
    many = distances(room, [x, x], [y, y], [heading, heading + 1])
    np.testing.assert_allclose(many[0], distances(room, x, y, heading))


def test_what_happens_follows_from_the_seed_whatever_is_read() -> None:
    one, other = Robot(5), Robot(5)
    for _ in range(1000):
        one.step()
        other.step()
        other.scan()
        assert one.readings == other.readings
    assert (one.x, one.y, one.command) == (other.x, other.y, other.command)
    assert Robot(6).room != one.room
    assert driven(6, 100).readings != one.readings


@pytest.mark.parametrize("seed", range(8))
def test_within_five_minutes_it_meets_everything_but_a_hand(seed: int) -> None:
    robot, met = Robot(seed), set[str]()
    for _ in range(3000):
        robot.step()
        met |= {name for name, value in robot.readings.items() if value == 1}
        met.add(robot.mode)
    wanted = {"bumper_left", "bumper_right", "docked", "charging"}
    assert wanted | {"cleaning", "docking"} <= met


def test_an_empty_robot_stands_until_it_is_carried_to_its_dock() -> None:
    robot = broken(driven(0, 10), "frozen", "battery")
    stood = 0
    while not robot._is_docked():
        robot.step()
        stood += robot._charge == 0
        assert stood < 20 or not any(robot._wheels)
        assert robot.time < 600
    assert stood * STEP == pytest.approx(120, abs=1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_wrong_before_its_moment(kind: FaultKind) -> None:
    moment = 60.0
    for seed in range(2):
        fault = RobotFault.drawn(kind, moment, seed)
        well, ill = RobotTopics(Robot(seed)), RobotTopics(Robot(seed, fault))
        for _ in range(round(moment / STEP) - 1):
            assert list(well.step()) == list(ill.step())
        assert any(list(well.step()) != list(ill.step()) for _ in range(6000)), fault


@pytest.mark.parametrize("what", ["bumper_left", "bumper_right", "docked"])
def test_a_stuck_switch_says_one_thing(what: str) -> None:
    for kind, wanted in (("stuck_on", 1), ("stuck_off", 0)):
        robot = broken(driven(1, 5), kind, what)  # type: ignore[arg-type]
        for _ in range(1000):
            robot.step()
            assert robot.readings[what] == wanted


@pytest.mark.slow
def test_what_is_frozen_stays_and_the_rest_does_not() -> None:
    for what in AFFECTED["frozen"]:
        robot = broken(driven(2, 30), "frozen", what)
        robot.step()
        held, ranges = dict(robot.readings), robot.scan()
        changed = set()
        for _ in range(1500):
            robot.step()
            read, still = robot.readings, np.array_equal(robot.scan(), ranges)
            changed |= {name for name in held if read[name] != held[name]}
            assert still == (what == "scan")
        assert what not in changed
        assert {"wheel_left", "wheel_right", "gyro", "battery"} - {what} <= changed


@pytest.mark.parametrize("what", AFFECTED["swapped"])
def test_swapped_wires_swap_what_is_read(what: str) -> None:
    names = f"{what}_left", f"{what}_right"
    well = driven(3, 1)
    while well.readings[names[0]] == well.readings[names[1]]:
        well.step()
    robot = broken(driven(3, well.time - STEP), "swapped", what)
    robot.step()
    read = [each.readings[name] for each in (well, robot) for name in names]
    assert read[:2] == read[:1:-1]


@pytest.mark.parametrize("topic", ["/scan", "/odom", "/mode"])
def test_a_silent_topic_is_all_that_is_missing(topic: str) -> None:
    robot = driven(4, 20)
    well, ill = RobotTopics(robot), RobotTopics(broken(robot, "silent", topic))
    for _ in range(300):
        said = list(well.step())
        assert list(ill.step()) == [each for each in said if each.topic != topic]


def test_motors_obey_late_and_no_later() -> None:
    robot = broken(driven(0, 5), "late", "cmd_vel", 0.7)
    told = [robot.command] * 8
    for _ in range(600):
        before = robot._wheels[1]
        robot.step()
        told.append(robot.command)
        if robot.readings["e_stop"] or len(told) < 16:
            continue
        speed, turn = told[-8]
        way = speed + turn * WHEELBASE / 2 - before
        assert robot._wheels[1] - before == pytest.approx(way * 0.4866, abs=2e-4)


@pytest.mark.parametrize("what", AFFECTED["slip"])
def test_a_slipping_wheel_loses_its_share_of_the_way(what: str) -> None:
    robot, shares = broken(driven(0, 5), "slip", what, 0.4), []
    for _ in range(1500):
        x, y, heading = robot.x, robot.y, robot.heading
        robot.step()
        turned = math.remainder(robot.heading - heading, 2 * math.pi) / STEP
        middle = heading + turned * STEP / 2
        speed = (
            (robot.x - x) * math.cos(middle) + (robot.y - y) * math.sin(middle)
        ) / STEP
        side = 1 if what == "right" else -1
        own = robot._wheels[side > 0]
        bumped = robot.readings["bumper_left"] or robot.readings["bumper_right"]
        if own > 0.1 and speed > 0.1 and not bumped:
            shares.append(1 - (speed + side * turned * WHEELBASE / 2) / own)
    assert len(shares) > 300
    assert np.median(shares) == pytest.approx(0.4, abs=0.01)


def test_what_no_fault_can_befall_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="fault: must be one of stuck_on"):
        RobotFault.drawn("melted", 1, 0)  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="fault slip: must be one of left, r"):
        RobotFault("slip", 1, "middle")
    sizes = [RobotFault.drawn("late", 1, seed).size for seed in range(50)]
    assert 0.3 <= min(sizes) < max(sizes) <= 1


def has(whole: Any, said: Any) -> None:
    """Check that a message has the fields that are said."""
    if isinstance(said, dict):
        for name, inner in said.items():
            has(getattr(whole, name), inner)
    else:
        assert np.array_equal(whole, said) or whole == pytest.approx(said)


@pytest.mark.slow
def test_messages_are_of_their_types_and_come_as_often_as_said() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)

    def check(value: object, node: Any) -> None:
        if node[0] == Nodetype.NAME:
            fields = dict(store.get_msgdef(node[1]).fields)
            assert isinstance(value, dict)
            for name, inner in value.items():
                check(inner, fields[name])
        elif node[0] != Nodetype.BASE:
            assert isinstance(value, list)
            for each in value:
                check(each, node[1][0])
        else:
            assert type(value) in (bool, int, float, str)

    filled = runpy.run_path(str(RECORD.with_name("node.py")))["filled"]
    topics = RobotTopics(Robot(0), start=1000.0)
    said = list(itertools.chain(*(topics.step() for _ in range(1000))))
    for each in said:
        check(each.message, (Nodetype.NAME, TYPES[each.topic]))
    for each in said[:130]:  # as a node sends it: whole, and what was said is in it
        kind = TYPES[each.topic]
        data = store.serialize_cdr(filled(kind, each.message), kind)
        has(store.deserialize_cdr(data, kind), each.message)
    assert {each.topic for each in said[:130]} == set(TYPES)
    counts = Counter(each.topic for each in said)
    assert counts["/odom"] == 2000
    assert {counts[t] for t in ("/scan", "/imu", "/wheels", "/cmd_vel")} == {1000}
    assert counts["/battery_state"] == 100
    assert all(100 <= counts[topic] < 130 for topic in ("/dock", "/e_stop", "/mode"))
    for topic in TYPES:
        times = [each.at for each in said if each.topic == topic]
        assert times == sorted(set(times))
        assert 1000 < times[0] <= times[-1] == pytest.approx(1100)


@pytest.mark.slow
def test_as_an_environment_it_is_the_robot_of_its_seed() -> None:
    env = gymnasium.make("neurosnap/Robot-v0", render_mode="rgb_array").unwrapped
    assert isinstance(env, RobotWorld)
    check_env(env)
    first, info = env.reset(seed=7)
    robot, sensors = driven(7, 40), env.sensors
    rows = [first, *(env.step(np.int64(0))[0] for _ in range(200))]
    assert (len(sensors), info["time"]) == (31, 0)
    assert env._robot is not None
    assert (env._robot.x, env._robot.readings) == (robot.x, robot.readings)
    on = dict(zip(sensors, np.array(rows).mean(0), strict=True))
    assert 0 < on["bumper_left"] < on["near_front_left"] < 1
    drawn = env.render()
    assert drawn.shape[2] == 3
    x, y = round(robot.x * 80), drawn.shape[0] - round(robot.y * 80)
    assert drawn[y, x].tolist() == [50, 90, 170]


@pytest.mark.parametrize(
    ("ray", "sector"),
    [(60, "front"), (3, "front"), (8, "front_left"), (16, "left"), (48, "right")],
)
def test_a_sector_is_where_its_name_says(ray: int, sector: str) -> None:
    ranges = np.ones(64)
    ranges[ray] = 0.4
    names = [name for name in SENSOR_TOPICS if name.startswith("near_")]
    on = [name for name, close in zip(names, near(ranges), strict=True) if close]
    assert on == [f"near_{sector}"]


@pytest.mark.slow
def test_a_silent_topic_leaves_its_sensors_as_they_were() -> None:
    seed = next(
        s for s in range(99) if RobotFault.drawn("silent", 60, s).what == "/scan"
    )
    env = RobotWorld(fault="silent", at=60.0)
    env.reset(seed=seed)
    rows = np.array([env.step(np.int64(0))[0] for _ in range(1500)])
    scans = np.array([topic == "/scan" for topic in SENSOR_TOPICS.values()])
    late = rows[299:]
    assert (late[:, scans] == late[0, scans]).all()
    assert rows[:299, scans].std(0).any()
    assert late[:, ~scans].std(0).any()


def test_an_environment_refuses_what_it_cannot_do() -> None:
    with pytest.raises(InvalidValueError, match="every: must be at least"):
        RobotWorld(every=0.01)
    with pytest.raises(InvalidValueError, match="fault: must be one of"):
        RobotWorld(fault="melted")  # type: ignore[arg-type]
    env = RobotWorld()
    with pytest.raises(ResetNeeded):
        env.render()
    with pytest.raises(ResetNeeded):
        env.step(np.int64(0))
    env.reset(seed=1)
    with pytest.raises(InvalidValueError, match="action: must be 0"):
        env.step(np.int64(1))


@pytest.mark.slow
def test_the_example_writes_what_any_program_would(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [tmp_path / name for name in ("well.mcap", "again.mcap", "ill.mcap")]
    broken_by = ["--fault", "silent", "--what", "/scan", "--at", "30"]
    for path, more in zip(paths, ([], [], broken_by), strict=True):
        line = ["record.py", str(path), "--minutes", "1", "--seed", "3", *more]
        monkeypatch.setattr(sys, "argv", line)
        runpy.run_path(str(RECORD), run_name="__main__")
    assert "from 30 s on: silent /scan" in capsys.readouterr().out
    well, again, ill = (path.read_bytes() for path in paths)
    assert well == again != ill
    topics, fields = describe_mcap(str(paths[0]))
    assert {each.topic for each in topics} == set(TYPES)
    scan = next(each for each in topics if each.topic == "/scan")
    assert (scan.messages, round(scan.every, 3)) == (600, 0.1)
    found = {each.topic: each.messages for each in describe_mcap(str(paths[2]))[0]}
    assert found["/scan"] == 299
    assert "/bumper/left.data" in {field.field for field in fields}
