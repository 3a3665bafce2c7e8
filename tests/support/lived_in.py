"""A made-up home: one person, a routine, sensors that go together."""

import numpy as np

from neurosnap.health.ten_minute_steps import Steps, steps_of

DAY = 86400.0
START = 1_600_041_600.0  # a midnight
SENSORS = ("bed", "bath", "flush", "hall", "fridge", "tap", "sofa", "door")
TASKS = {
    "bath": (("hall", 0.9), ("bath", 0.97), ("flush", 0.9), ("tap", 0.6)),
    "kitchen": (("hall", 0.8), ("fridge", 0.9), ("tap", 0.8)),
    "sofa": (("sofa", 0.95), ("hall", 0.5)),
    "out": (("hall", 0.95), ("door", 0.98)),
    "bed": (("bed", 0.97), ("bath", 0.5)),
}
"""What is done, and which sensors come on with which probability."""

Interval = tuple[float, float, int]


def lived_in(days: int, seed: int) -> list[Interval]:
    """Return when sensors were on: start, end, and number in `SENSORS`, in order."""
    rng = np.random.default_rng(seed)
    made = []
    for day in range(days):
        for task, often in (
            ("bath", 5),
            ("kitchen", 5),
            ("sofa", 3),
            ("out", 2),
            ("bed", 2),
        ):
            for hour in rng.uniform(7, 23, rng.poisson(often - 1) + 1):
                for name, chance in TASKS[task]:
                    if rng.random() < chance:
                        start = START + day * DAY + hour * 3600 + rng.uniform(0, 300)
                        lasts = rng.uniform(2, 60)
                        made.append((start, start + lasts, SENSORS.index(name)))
    return sorted(made)


def in_steps(intervals: list[Interval], days: int) -> Steps:
    """Return the steps of so many days."""
    return steps_of(intervals, len(SENSORS), START, START + days * DAY)
