"""A small robot that cleans a room, simulated: two driven wheels, bumpers, a dock.

It drives itself: straight on or in an arc until it bumps into a wall or a post, back,
and off in another direction. With little charge left it goes to its dock. Now and then
somebody presses its emergency stop. It stores its charge in capacitors, which last for
four minutes and are full again after one, so all of this happens within five minutes.

What it reads can be made wrong from a moment on (`RobotFault`). It then drives by what
it reads. All that happens follows from the seed and the fault.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError

STEP = 0.1
"""Seconds of a step."""
RADIUS = 0.17
"""Of the robot, in metres, as all lengths are."""
WHEELBASE = 0.24
RAYS = 64
LOW, FULL = 0.2, 0.95
"""Shares of charge: goes to the dock below the one, leaves it at the other."""
TYPES = {
    "/bumper/left": "std_msgs/msg/Bool",
    "/bumper/right": "std_msgs/msg/Bool",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/imu": "sensor_msgs/msg/Imu",
    "/odom": "nav_msgs/msg/Odometry",
    "/wheels": "sensor_msgs/msg/JointState",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/battery_state": "sensor_msgs/msg/BatteryState",
    "/dock": "std_msgs/msg/Bool",
    "/e_stop": "std_msgs/msg/Bool",
    "/mode": "std_msgs/msg/String",
}
"""What it publishes, and the type of each: ``/odom`` 20 times a second, the others
ten times, but for `RARE`."""
RARE = "/battery_state", "/dock", "/e_stop", "/mode"
"""Come once a second; all but the first also when they change."""
FaultKind: TypeAlias = Literal[
    "stuck_on", "stuck_off", "frozen", "swapped", "silent", "late", "slip"
]
"""What goes wrong: a switch reads 1, or 0; a measurement stays as it is; two wires are
swapped; a topic is published no more; commands reach the motors late; a wheel slips."""
_SWITCHES = ("bumper_left", "bumper_right", "docked")
AFFECTED: dict[FaultKind, tuple[str, ...]] = {
    "stuck_on": _SWITCHES,
    "stuck_off": _SWITCHES,
    "frozen": ("wheel_left", "wheel_right", "gyro", "battery", "scan"),
    "swapped": ("bumper", "wheel"),
    "silent": tuple(TYPES),
    "late": ("cmd_vel",),
    "slip": ("left", "right"),
}
"""What each kind of fault can befall."""
_LATE = 0.3, 1.0  # seconds
_SLIP = 0.2, 0.6  # share of a wheel's way that is lost: from dust to a wet floor

_SPEED, _BACK, _TURN, _CREEP = 0.25, -0.15, 1.5, 0.1  # m/s, and rad/s
_LAG = 1 - math.exp(-STEP / 0.15)  # of the motors, whose time constant is 0.15 s
_TOUCH = 0.002  # gap that presses a bumper
_STANDBY, _DRIVING, _CLEANING, _CHARGING = 0.0002, 0.001, 0.0025, 0.012  # charge a s
_RANGE_NOISE = 0.01
_PRESSED_EVERY = 900.0  # seconds between two emergency stops, in the mean
_CARRIED_AFTER = 120.0  # seconds that it stands about empty
_BEFORE_DOCK = 0.8  # how far off it turns towards the dock
_OFF_DOCK = 0.015
_MARGIN = 2 * RADIUS + 0.2  # between posts, so that it is never trapped
_ANGLES = 2 * math.pi * np.arange(RAYS) / RAYS

Floats: TypeAlias = NDArray[np.float64]
Pose: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class RobotFault:
    """Something that goes wrong, and from when on.

    Attributes:
        kind: What.
        at: Seconds from the start.
        what: Where, of `AFFECTED`.
        size: Of a late command seconds, of a slipping wheel the share it loses.
    """

    kind: FaultKind
    at: float
    what: str
    size: float = 0.0

    def __post_init__(self) -> None:
        """Check it."""
        for name, value, known in (
            ("fault", self.kind, AFFECTED),
            (f"fault {self.kind}", self.what, AFFECTED.get(self.kind, ())),
        ):
            if value not in known:
                rule = f"must be one of {', '.join(known)}"
                raise InvalidValueError(name, rule, value)

    @classmethod
    def drawn(
        cls, kind: FaultKind, at: float, seed: int, what: str | None = None
    ) -> "RobotFault":
        """Return a fault of a kind; the seed draws its size, and what fails if None."""
        rng = np.random.default_rng([seed, 1])
        low, high = {"late": _LATE, "slip": _SLIP}.get(kind, (0.0, 0.0))
        where = AFFECTED.get(kind, ("",))  # of no kind: refused by the check
        drawn = str(rng.choice(where))
        return cls(kind, at, what or drawn, float(rng.uniform(low, high)))


class Room(NamedTuple):
    """Four walls, round posts, and a dock in the middle of the wall at ``x`` 0."""

    width: float
    depth: float
    posts: list[tuple[float, float, float]]
    """The middle and the radius of each."""

    @property
    def dock(self) -> tuple[float, float]:
        """Where the middle of a docked robot is; it faces the wall."""
        return RADIUS + _OFF_DOCK, self.depth / 2


def furnished(rng: Generator) -> Room:
    """Draw a room with three to six posts; the way to the dock is clear."""
    room = Room(float(rng.uniform(3.5, 5)), float(rng.uniform(3, 4)), [])
    wanted = int(rng.integers(3, 7))
    for _ in range(200):
        radius = float(rng.uniform(0.08, 0.25))
        edge = radius + _MARGIN
        x = float(rng.uniform(edge, room.width - edge))
        y = float(rng.uniform(edge, room.depth - edge))
        apart = all(math.dist((x, y), p[:2]) > edge + p[2] for p in room.posts)
        clear = math.dist((x, y), (0, room.depth / 2)) > edge + _BEFORE_DOCK
        if apart and clear:
            room.posts.append((x, y, radius))
        if len(room.posts) == wanted:
            break
    return room


def distances(room: Room, x: ArrayLike, y: ArrayLike, heading: ArrayLike) -> Floats:
    """Return how far walls and posts are from one place, or from many at once.

    Returns:
        ``(..., RAYS)``, from ahead to the left around.
    """
    x, y, heading = (np.asarray(of, float)[..., None] for of in (x, y, heading))
    cos, sin = np.cos(heading + _ANGLES), np.sin(heading + _ANGLES)
    with np.errstate(divide="ignore", over="ignore"):
        far = np.minimum(
            np.where(cos > 0, room.width - x, x) / abs(cos),
            np.where(sin > 0, room.depth - y, y) / abs(sin),
        )
    for at, beside, radius in room.posts:
        toward = cos * (at - x) + sin * (beside - y)
        inside = toward**2 - ((at - x) ** 2 + (beside - y) ** 2 - radius**2)
        hit = toward - np.sqrt(np.maximum(inside, 0))
        far = np.where((inside > 0) & (toward > 0), np.minimum(far, hit), far)
    return np.asarray(far)


class Robot:
    """A robot in a room of its own.

    Args:
        seed: Draws the room and all that is left to chance.
        fault: What goes wrong, if anything does.

    Attributes:
        room: Where it is.
        time: Seconds since the start.
        x, y, heading: Where it truly is, and where it faces, in radians.
        mode: ``cleaning``, ``docking``, ``charging`` or ``stopped``.
        command: The speed, and the turn to the left, that its controller asks for.
        readings: What each of its sensors says; `scan` is apart.
        odometry: Where it believes to be by its wheels, half a step ago and now: ``x``,
            ``y``, heading.
    """

    def __init__(self, seed: int, fault: RobotFault | None = None) -> None:
        # What is read more or less often must not change what happens.
        rngs = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))
        furniture, self._chance, self._noise, self._range_noise = rngs
        self.room = furnished(furniture)
        self.fault = fault
        self.steps = 0
        self.x, self.y = self.room.dock
        self.x += _BEFORE_DOCK
        self.heading = float(self._chance.uniform(-1, 1))
        self.mode = "cleaning"
        self.command = 0.0, 0.0
        self.odometry = [(0.0, 0.0, 0.0)] * 2
        self._before = self.mode  # it was stopped
        self._plan: deque[list[float]] = deque()  # speed, turn, seconds left
        self._homing = False
        self._wheels = [0.0, 0.0]
        self._charge = 0.5
        self._pressed = 0.0  # until when
        self._empty = 0.0  # for how long
        self._sent: deque[tuple[float, float]] = deque(maxlen=32)
        self._drawn: list[list[float]] = []
        self._frozen: Floats | None = None
        self._held: float | None = None
        self.readings: dict[str, float] = {}
        self._read([], 0.0, [0.0] * 3)

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.steps * STEP

    def failing(self, kind: FaultKind) -> str:
        """Return what fails in such a way now; empty: nothing."""
        fault = self.fault
        if fault is None or fault.kind != kind or self.time < fault.at - STEP / 2:
            return ""
        return fault.what

    def step(self) -> None:
        """Let a tenth of a second pass."""
        self.steps += 1
        self.command = self._controlled()
        self._sent.append(self.command)
        late = self.fault.size / STEP if self.fault and self.failing("late") else 0
        speed, turn = self._sent[max(-1 - round(late), -len(self._sent))]
        if self._pressed > self.time or self._charge <= 0:
            speed = turn = 0.0  # the motors have no power, whatever is asked for
        if not self._drawn:
            self._drawn = self._noise.standard_normal((1024, 5)).tolist()
        noise = self._drawn.pop()
        ways = []
        for side, sign in enumerate((-1, 1)):
            wanted, own = speed + sign * turn * WHEELBASE / 2, self._wheels[side]
            own += (wanted - own) * _LAG
            self._wheels[side] = own = own if abs(own) > 1e-4 else 0.0
            slips = self.fault and self.failing("slip") == ("left", "right")[side]
            lost = self.fault.size if self.fault and slips else 0.0
            ways.append(own * (1 - lost - 0.01 * noise[side]))
        turned = (ways[1] - ways[0]) / WHEELBASE
        touched = self._move((ways[0] + ways[1]) / 2, turned)
        self._spend()
        self._read(touched, turned, noise[2:])

    def scan(self) -> Floats:
        """Return how far it is in each direction, from the front to the left around."""
        is_frozen = self.failing("frozen") == "scan"
        if is_frozen and self._frozen is not None:
            return self._frozen
        far = distances(self.room, self.x, self.y, self.heading)
        ranges = far + _RANGE_NOISE * self._range_noise.standard_normal(RAYS)
        self._frozen = ranges if is_frozen else None
        return ranges

    def _move(self, speed: float, turned: float) -> list[float]:
        """Move, but into nothing; return in which directions something is touched."""
        middle = self.heading + turned * STEP / 2
        self.heading = math.remainder(self.heading + turned * STEP, 2 * math.pi)
        x = self.x + speed * STEP * math.cos(middle)
        y = self.y + speed * STEP * math.sin(middle)
        touched = []
        for px, py, radius in self.room.posts:
            apart, least = math.dist((x, y), (px, py)), radius + RADIUS
            if apart < least + _TOUCH:
                touched.append(math.atan2(py - y, px - x))
            if apart < least:
                x, y = px + (x - px) * least / apart, py + (y - py) * least / apart
        walls = (
            (x - RADIUS, math.pi),
            (self.room.width - RADIUS - x, 0.0),
            (y - RADIUS, -math.pi / 2),
            (self.room.depth - RADIUS - y, math.pi / 2),
        )
        touched += [where for gap, where in walls if gap < _TOUCH]
        self.x = min(max(x, RADIUS), self.room.width - RADIUS)
        self.y = min(max(y, RADIUS), self.room.depth - RADIUS)
        return [math.remainder(where - self.heading, 2 * math.pi) for where in touched]

    def _spend(self) -> None:
        """Use charge, or take it from the dock; let people do what they do."""
        change = -_STANDBY
        if any(self._wheels):
            change -= _DRIVING
        if self.mode == "cleaning":
            change -= _CLEANING
        if self._is_docked():
            change = _CHARGING
        self._charge = min(max(self._charge + change * STEP, 0.0), 1.0)
        self._empty = 0.0 if self._charge > 0 else self._empty + STEP
        if self._empty > _CARRIED_AFTER:
            (self.x, self.y), self.heading = self.room.dock, math.pi
        if self.mode == "cleaning" and self._chance.random() < STEP / _PRESSED_EVERY:
            self._pressed = self.time + float(self._chance.uniform(5, 20))

    def _is_docked(self) -> bool:
        x, y = self.room.dock
        off = abs(math.remainder(self.heading - math.pi, 2 * math.pi))
        return self.x < x + 0.025 and abs(self.y - y) < 0.03 and off < 0.3

    def _read(self, touched: list[float], turned: float, noise: list[float]) -> None:
        """Read all sensors, of which some may be broken."""
        docked = self._is_docked()
        read = {
            "bumper_left": float(any(-0.2 < where < 1.6 for where in touched)),
            "bumper_right": float(any(-1.6 < where < 0.2 for where in touched)),
            "docked": float(docked),
            "charging": float(docked and self._charge < 1),
            "e_stop": float(self._pressed > self.time),
            "battery": round(self._charge, 3),
            "wheel_left": self._wheels[0] * (1 + 0.01 * noise[0]),
            "wheel_right": self._wheels[1] * (1 + 0.01 * noise[1]),
            "gyro": turned + 0.01 * noise[2],
        }
        for kind in ("stuck_on", "stuck_off"):
            if what := self.failing(kind):
                read[what] = float(kind == "stuck_on")
        if (what := self.failing("frozen")) in read:
            self._held = read[what] if self._held is None else self._held
            read[what] = self._held
        if what := self.failing("swapped"):
            left, right = f"{what}_left", f"{what}_right"
            read[left], read[right] = read[right], read[left]
        self.readings = read
        half = _advanced(self.odometry[1], *self.odometer)
        self.odometry = [half, _advanced(half, *self.odometer)]

    @property
    def odometer(self) -> tuple[float, float]:
        """The speed, and the turn, that its wheels say."""
        left, right = self.readings["wheel_left"], self.readings["wheel_right"]
        return (left + right) / 2, (right - left) / WHEELBASE

    def _controlled(self) -> tuple[float, float]:
        """Return speed and turn, by what it reads and its dock's beacon."""
        read = self.readings
        if read["e_stop"] or read["battery"] <= 0:
            if self.mode != "stopped":
                self._before, self.mode = self.mode, "stopped"
            return 0.0, 0.0
        if self.mode == "stopped":
            self.mode = self._before
        if self.mode == "docking" and read["docked"]:
            self.mode = "charging"
        if self.mode == "charging":
            if read["docked"] and read["battery"] < FULL:
                return 0.0, 0.0
            self.mode = "cleaning"
            self._plan.clear()
            self._go(_BACK, 0.0, 3.0)
            self._go(0.0, _TURN * self._side(), 1.4, 2.1)
        elif self.mode == "cleaning" and read["battery"] < LOW:
            self.mode, self._homing = "docking", False
        elif self.mode == "docking" and read["battery"] >= FULL:
            self.mode = "cleaning"
        return self._manoeuvre()

    def _manoeuvre(self) -> tuple[float, float]:
        left, right = self.readings["bumper_left"], self.readings["bumper_right"]
        backs = bool(self._plan) and self._plan[0][0] < 0
        if (left or right) and not backs:
            self._plan.clear()
            self._homing = False
            away = self._side() if left and right else -1 if left else 1
            self._go(_BACK, 0.0, 0.8)
            self._go(0.0, _TURN * away, 0.4, 1.4)
            if self.mode == "docking":
                self._go(_SPEED, 0.0, 1.0, 4.0)
        while self._plan and self._plan[0][2] < STEP / 2:
            self._plan.popleft()
        if not self._plan:
            if self.mode == "docking":
                return self._toward_dock()
            bent = 0.25 * self._side() if self._chance.random() < 0.3 else 0.0
            self._go(_SPEED, bent, 4.0, 12.0)
            self._go(0.0, _TURN * self._side(), 0.3, 1.4)
        self._plan[0][2] -= STEP
        return self._plan[0][0], self._plan[0][1]

    def _toward_dock(self) -> tuple[float, float]:
        x, y = self.room.dock
        if not self._homing:
            x += _BEFORE_DOCK
            self._homing = math.dist((x, y), (self.x, self.y)) < 0.1
        bearing = math.atan2(y - self.y, x - self.x)
        off = math.remainder(bearing - self.heading, 2 * math.pi)
        turn = min(max(2 * off, -_TURN), _TURN)
        if abs(off) > 0.5:
            return 0.0, turn
        return (_CREEP if self._homing else _SPEED), turn

    def _go(self, speed: float, turn: float, least: float, most: float = 0.0) -> None:
        """Plan to drive so for a while."""
        seconds = float(self._chance.uniform(least, most)) if most else least
        self._plan.append([speed, turn, seconds])

    def _side(self) -> int:
        return 1 if self._chance.random() < 0.5 else -1


def _advanced(pose: Pose, speed: float, turn: float) -> Pose:
    """Return where one is half a step after a pose."""
    middle = pose[2] + turn * STEP / 4
    way = speed * STEP / 2
    x, y = pose[0] + way * math.cos(middle), pose[1] + way * math.sin(middle)
    return x, y, math.remainder(pose[2] + turn * STEP / 2, 2 * math.pi)
