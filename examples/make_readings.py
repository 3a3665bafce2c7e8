"""Writes readings.csv, a made-up hour of a packing line: `python make_readings.py`.

Ten sensors, a row whenever one of them has changed. What holds by design:

    motor -> power               the motor needs power
    moving -> motor              the belt moves only when driven
    door -> motor*               an open door stops the motor
    heavy -> scale               weight is felt only by the scale
    pusher -> heavy              the pusher takes heavy parcels off
    green -> power, red -> power, green -> red*, and green means that the motor is on

One fault is put in: in rows 380 to 384 the belt's sensor says that it moves while the
motor is off.
"""

import csv
import random
from pathlib import Path

SENSORS = (
    "power",
    "motor",
    "moving",
    "door",
    "entry",
    "scale",
    "heavy",
    "pusher",
    "green",
    "red",
)
ROWS = 400
FAULT = range(380, 385)


def rows(seed: int) -> list[list[int]]:
    """Return the readings, one row a change."""
    draw = random.Random(seed).random
    power = door = speed = False
    parcel = None  # or whether it is heavy, once it lies on the scale
    made: list[list[int]] = []
    while len(made) < ROWS:
        power = draw() < (0.97 if power else 0.5)
        door = draw() < (0.6 if door else 0.08)
        motor = power and not door and draw() < 0.9
        speed = motor and (speed or draw() < 0.5)
        on_scale = parcel is not None
        heavy = bool(parcel)
        pusher = heavy and power and draw() < 0.5
        entry = speed and draw() < 0.4
        if pusher or (speed and draw() < 0.5):
            parcel = None
        elif speed and parcel is None and draw() < 0.6:
            parcel = draw() < 0.4
        red = power and not motor
        row = [power, motor, speed, door, entry, on_scale, heavy, pusher, motor, red]
        if len(made) in FAULT:
            row[SENSORS.index("moving")] = True
        if not made or [int(one) for one in row] != made[-1]:
            made.append([int(one) for one in row])
    return made


def main() -> None:
    """Write the file beside this one."""
    path = Path(__file__).with_name("readings.csv")
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(SENSORS)
        writer.writerows(rows(seed=1))


if __name__ == "__main__":
    main()
