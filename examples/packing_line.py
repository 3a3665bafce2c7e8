"""Writes what a simulated packing line logs, a row a second, as CSV.

Try it: ``python packing_line.py log.csv --to 8 --fault late --at 4``.

A gate lets in six bottles. They are counted, stopped on a scale, filled by weight, and
put into a box by a pusher at the end of the belt. What holds by design:

    emergency_stop -> motor*, valve*     jam -> motor*, belt -> motor
    belt and gate -> the count rises     motor -> belt within 1 s
    pusher_in -> pusher_out*             barrier_1 -> barrier_2 after 3 s of belt
    flow -> valve                        valve -> flow within 3 s, or closed again
"""

import argparse
import csv
import random
from datetime import UTC, datetime, timedelta
from pathlib import Path

START = datetime(2026, 10, 5, 6, tzinfo=UTC)
BATCH = 6
BARRIER_1, BARRIER_2, HOLD, BARRIER_3, END = 1, 4, 10, 13, 19  # a second from 0 to 1
BEFORE, FILLER, PUSHER = slice(HOLD + 1), slice(5, HOLD + 1), slice(14, END + 1)
EMPTY, FILL, FLOW = 0.3, 1.0, 0.09  # kg: of a bottle, into it, into it each second
STROKE = 3  # how far the pusher goes
FAULTS = "barrier_2 stuck at on, flow 4 s late, the scale 0.5 kg an hour too high"


class Line:
    """The line with its controller."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.places = [False] * (END + 1)
        self.motor = self.belt = self.gate = self.valve = self.flow = self.push = False
        self.is_filled = self.is_toppled = False
        self.count = self.pushed = self.covered = 0
        self.emergency = self.jam = self.pause = self.opening = 0  # seconds to go
        self.liquid = self.dirt = self.weight = 0.0  # kg; the first is in each bottle

    def step(self, fault: str | None) -> dict[str, int | float]:
        """Let a second pass; return what is read at its end."""
        self._control()
        if self.belt:
            self._move()
        wait = self.random.randint(1, 2) + (4 if fault == "late" else 0)
        self.opening = self.opening - 1 if self.valve else wait
        self.flow = self.valve and self.opening < 0
        self.liquid += self.flow * FLOW * self.random.uniform(0.9, 1.1)
        if not self.emergency and (self.push or self.pushed):
            stroke = self.random.choice((1, 1, 2)) * (1 if self.push else -1)
            self.pushed = min(max(self.pushed + stroke, 0), STROKE)
            if self.pushed == STROKE:
                self.places[PUSHER] = [False] * BATCH
        self.dirt += 0.5 / 3600 if fault == "drift" else 0
        bottles = sum(self.places[FILLER]) * (EMPTY + self.liquid)
        self.weight = round(bottles + self.dirt + self.random.gauss(0, 0.02), 2)
        return {
            "emergency_stop": self.emergency > 0,
            "motor": self.motor,
            "belt": self.belt,
            "gate": self.gate,
            "count": self.count,
            "barrier_1": self.places[BARRIER_1],
            "barrier_2": self.places[BARRIER_2] or fault == "stuck",
            "valve": self.valve,
            "flow": self.flow,
            "weight": self.weight,
            "barrier_3": self.places[BARRIER_3],
            "jam": self.jam > 0,
            "push": self.push,
            "pusher_in": self.pushed == 0,
            "pusher_out": self.pushed == STROKE,
        }

    def _control(self) -> None:
        """Switch by what was read a second ago."""
        self.emergency = max(0, self.emergency - 1)
        if self.random.random() < 1 / 1200:
            self.emergency = self.random.randint(15, 60)
        self.covered = self.covered + 1 if self.places[BARRIER_3] and self.belt else 0
        self.jam = max(0, self.jam - 1)
        if self.covered > BATCH + 2:  # it is cleared within a minute
            self.jam, self.is_toppled = self.random.randint(20, 60), False
        was_on, self.motor = self.motor, not self.emergency and not self.jam
        self.belt = was_on and self.motor
        if not any(self.places[BEFORE]):
            self.is_filled, self.liquid, self.pause = False, 0.0, self.pause - 1
            self.gate = self.pause < 0
        elif sum(self.places[BEFORE]) == BATCH and self.gate:
            self.gate, self.pause = False, self.random.randint(0, 8)
        self.is_filled |= self.valve and self.weight >= BATCH * (EMPTY + FILL)
        self.valve = all(self.places[FILLER]) and not (self.is_filled or self.emergency)
        self.push = all(self.places[PUSHER]) and not self.emergency

    def _move(self) -> None:
        """Move on each bottle that is not held and has room before it."""
        at, held = self.places, {HOLD: not self.is_filled, BARRIER_3: self.is_toppled}
        for place in reversed(range(END)):
            if at[place] and not at[place + 1] and not held.get(place):
                at[place : place + 2] = [False, True]
        self.places[0] = self.gate
        self.count += self.gate
        self.is_toppled |= self.places[BARRIER_3] and self.random.random() < 1 / 150


def main() -> None:
    """Read the command line, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="draws what happens")
    parser.add_argument("--since", type=int, default=0, help="hour of its first row")
    parser.add_argument("--to", type=int, default=24, help="hour that it goes on to")
    parser.add_argument("--fault", choices=("stuck", "late", "drift"), help=FAULTS)
    parser.add_argument("--at", type=int, default=4, help="hour that the fault begins")
    given = parser.parse_args()
    line, first = Line(given.seed), given.since * 3600
    with given.path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        for second in range(given.to * 3600):
            row = line.step(given.fault if second >= given.at * 3600 else None)
            if second == first:
                writer.writerow(["time", *row])
            if second >= first:
                time = START + timedelta(seconds=second)
                writer.writerow([f"{time:%F %T}", *(+value for value in row.values())])


if __name__ == "__main__":
    main()
