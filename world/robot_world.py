"""What the robot publishes, and the robot as an environment that is watched.

Messages are those of ROS 2, as plain dicts; fields that it leaves empty are left out.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

from .robot import LOW, RADIUS, RARE, RAYS, STEP, FaultKind, Robot, RobotFault

_CHARGING, _DISCHARGING = 1, 2  # of BatteryState
_SECTORS = (
    *("front", "front_left", "left", "rear_left"),
    *("rear", "rear_right", "right", "front_right"),
)
_MODES = ("cleaning", "docking", "charging", "stopped")
SENSOR_TOPICS = {
    **{f"bumper_{side}": f"/bumper/{side}" for side in ("left", "right")},
    **{f"near_{sector}": "/scan" for sector in _SECTORS},
    **dict.fromkeys(("told_to_move", "told_forward", "told_back"), "/cmd_vel"),
    **dict.fromkeys(("told_left", "told_right"), "/cmd_vel"),
    **{f"wheel_{side}_forward": "/wheels" for side in ("left", "right")},
    **{f"wheel_{side}_back": "/wheels" for side in ("left", "right")},
    **dict.fromkeys(("moves", "moves_forward"), "/odom"),
    **dict.fromkeys(("turns_left", "turns_right"), "/imu"),
    **dict.fromkeys(("battery_low", "charging"), "/battery_state"),
    "docked": "/dock",
    "e_stop": "/e_stop",
    **{f"is_{mode}": "/mode" for mode in _MODES},
}
"""Its binary sensors, and the topic that each is read from."""
_NEAR, _MOVES, _TURNS = 0.5, 0.03, 0.4  # m, m/s, rad/s
_RAY = 2 * math.pi / RAYS
_SCALE = 80  # pixels a metre


def near(ranges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return in which sectors something is near: ``(..., RAYS)`` to ``(..., 8)``."""
    sectors = np.roll(ranges, RAYS // 16, -1).reshape(*ranges.shape[:-1], 8, -1)
    return np.asarray(sectors.min(-1) < _NEAR)


def sensed(robot: Robot, sectors: Sequence[bool]) -> list[bool]:
    """Return what its binary sensors say, in the order of `SENSOR_TOPICS`.

    Args:
        robot: The robot.
        sectors: Where it is near something, see `near`.
    """
    read, (told, told_turn) = robot.readings, robot.command
    speed, turn = robot.odometer
    left, right, gyro = read["wheel_left"], read["wheel_right"], read["gyro"]
    return [
        *(read["bumper_left"] > 0, read["bumper_right"] > 0),
        *sectors,
        *(told != 0 or told_turn != 0, told > 0, told < 0),
        *(told_turn > _TURNS, told_turn < -_TURNS),
        *(left > _MOVES, right > _MOVES, left < -_MOVES, right < -_MOVES),
        *(abs(speed) > _MOVES or abs(turn) > _TURNS, speed > _MOVES),
        *(gyro > _TURNS, gyro < -_TURNS),
        *(read["battery"] < LOW, read["charging"] > 0),
        *(read["docked"] > 0, read["e_stop"] > 0),
        *(robot.mode == mode for mode in _MODES),
    ]


class Published(NamedTuple):
    """A message that the robot publishes."""

    at: float
    """Seconds since 1970."""
    topic: str
    message: dict[str, Any]


class RobotTopics:
    """Publishes what a robot reads, each topic as often as is usual.

    Args:
        robot: The robot.
        start: When it starts, seconds since 1970.
    """

    def __init__(self, robot: Robot, start: float = 0.0) -> None:
        self.robot = robot
        self._start = start
        self._said: dict[str, dict[str, Any]] = {}

    def step(self) -> Iterator[Published]:
        """Let the robot make a step, and yield what it publishes, in order of time."""
        robot = self.robot
        robot.step()
        now = self._start + robot.time
        silent = robot.failing("silent")
        whole = robot.steps % round(1 / STEP) == 0
        for at, topic, message in self._all(now):
            due = whole if topic in RARE else True
            if topic in RARE[1:]:
                due |= self._said.get(topic) != message
                self._said[topic] = message
            if topic != silent and due:
                yield Published(at, topic, message)

    def _all(self, now: float) -> Iterator[tuple[float, str, dict[str, Any]]]:
        robot, read = self.robot, self.robot.readings
        speed, turn = robot.odometer
        twist = {"linear": _vector(speed), "angular": _vector(z=turn)}
        for (x, y, heading), at in zip(
            robot.odometry, (now - STEP / 2, now), strict=True
        ):
            turned = _vector(z=math.sin(heading / 2)) | {"w": math.cos(heading / 2)}
            pose = {"position": _vector(x, y), "orientation": turned}
            place = {"pose": {"pose": pose}, "twist": {"twist": twist}}
            yield at, "/odom", _header(at, "odom") | {"child_frame_id": "base"} | place
        for side in ("left", "right"):
            yield now, f"/bumper/{side}", {"data": read[f"bumper_{side}"] > 0}
        angles = {"angle_max": _RAY * (RAYS - 1), "angle_increment": _RAY}
        scan = {"scan_time": STEP, "range_min": 0.05, "range_max": 12.0} | angles
        ranges = robot.scan().round(3).tolist()
        yield now, "/scan", _header(now, "scan") | scan | {"ranges": ranges}
        gyro = {"angular_velocity": _vector(z=read["gyro"])}
        yield now, "/imu", _header(now, "imu") | gyro
        names = ["wheel_left", "wheel_right"]
        wheels = {"name": names, "velocity": [read[name] for name in names]}
        yield now, "/wheels", _header(now, "base") | wheels
        told = {
            "linear": _vector(robot.command[0]),
            "angular": _vector(z=robot.command[1]),
        }
        yield now, "/cmd_vel", told
        status = _CHARGING if read["charging"] else _DISCHARGING
        battery = {"percentage": read["battery"], "power_supply_status": status}
        yield now, "/battery_state", _header(now, "base") | battery
        yield now, "/dock", {"data": read["docked"] > 0}
        yield now, "/e_stop", {"data": read["e_stop"] > 0}
        yield now, "/mode", {"data": robot.mode}


def _header(at: float, frame: str) -> dict[str, Any]:
    sec, rest = divmod(round(at * 1e9), 1_000_000_000)
    return {"header": {"stamp": {"sec": sec, "nanosec": rest}, "frame_id": frame}}


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


class RobotWorld(gymnasium.Env[NDArray[np.int8], np.int64]):
    """A robot that cleans a room by itself, and is watched.

    Description:
        See `world.robot`. The seed of a reset draws the room and the robot.

    Sensors:
        `SENSOR_TOPICS`: bumpers; in which of eight sectors something is nearer than
        0.5 m; what it is told to do; how its wheels turn; whether it moves by these;
        whether it turns by its gyroscope; battery, dock, emergency stop, mode. What is
        not published any more stays as it was.

    Actions:
        ``watch``. It drives itself.

    Start:
        Before its dock, with half its charge.

    Reward:
        0.

    End:
        Never.

    Info:
        ``time``, in seconds; ``x``, ``y`` and ``heading``, where it truly is.

    Args:
        every: Seconds from one observation to the next.
        fault: One of `world.robot.AFFECTED`; empty: nothing goes wrong.
        at: When it goes wrong, in seconds. The seed draws the rest.
        render_mode: None, or ``rgb_array``.

    Raises:
        InvalidValueError: An argument breaks its rule.
        ResetNeeded: From `step` and `render`: there was no reset.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012 - theirs

    def __init__(
        self,
        every: float = 0.2,
        fault: FaultKind | Literal[""] = "",
        at: float = 600.0,
        render_mode: str | None = None,
    ) -> None:
        if not every >= STEP:
            raise InvalidValueError("every", f"must be at least {STEP} s", every)
        self.sensors = tuple(SENSOR_TOPICS)
        self.orders = (0,) * len(self.sensors)
        self.actions = ("watch",)
        self.observation_space = MultiBinary(len(self.sensors))
        self.action_space = Discrete(len(self.actions))
        self.render_mode = render_mode
        self._steps = round(every / STEP)
        self._fault, self._at = fault, at
        if fault:
            RobotFault.drawn(fault, at, 0)
        self._robot: Robot | None = None
        self._seen = np.zeros(len(self.sensors), np.int8)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Put a robot before its dock, in a room of its own."""
        super().reset(seed=seed, options=options)
        if seed is None:
            seed = int(self.np_random.integers(1 << 31))
        fault = RobotFault.drawn(self._fault, self._at, seed) if self._fault else None
        self._robot = Robot(seed, fault)
        return self._observed(self._robot)

    def step(
        self, action: np.int64
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        """Let time pass; nothing is rewarded, nor ever ends."""
        if self._robot is None:
            raise ResetNeeded("step: needs a reset before")
        if not self.action_space.contains(action):
            raise InvalidValueError("action", "must be 0", action)
        for _ in range(self._steps):
            self._robot.step()
        seen, info = self._observed(self._robot)
        return seen, 0.0, False, False, info

    def _observed(self, robot: Robot) -> tuple[NDArray[np.int8], dict[str, Any]]:
        seen = np.array(sensed(robot, near(robot.scan()).tolist()), np.int8)
        silent = robot.failing("silent")
        gone = [topic == silent for topic in SENSOR_TOPICS.values()]
        seen[gone] = self._seen[gone]
        self._seen = seen
        where = {"x": robot.x, "y": robot.y, "heading": robot.heading}
        return seen.copy(), {"time": robot.time, **where}

    def render(self) -> NDArray[np.uint8]:
        """Draw the room from above: posts are grey, the dock is green."""
        if self._robot is None:
            raise ResetNeeded("render: needs a reset before")
        robot, room = self._robot, self._robot.room
        y, x = np.mgrid[room.depth : 0 : -1 / _SCALE, 0 : room.width : 1 / _SCALE]
        image = np.full((*x.shape, 3), 245, np.uint8)
        nose = robot.x + 0.1 * math.cos(robot.heading)
        ahead = robot.y + 0.1 * math.sin(robot.heading)
        for middle, radius, colour in (
            *((post[:2], post[2], (120, 120, 120)) for post in room.posts),
            ((0.0, room.dock[1]), RADIUS, (60, 160, 90)),
            ((robot.x, robot.y), RADIUS, (50, 90, 170)),
            ((nose, ahead), 0.04, (255, 255, 255)),
        ):
            image[(x - middle[0]) ** 2 + (y - middle[1]) ** 2 < radius**2] = colour
        return image
