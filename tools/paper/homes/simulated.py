"""Simulates homes in which nothing is broken, to choose the health monitor's constants.

People follow habits by the local clock, with other ones on free days. Guests come,
holidays leave a home empty, a pet wanders, seasons and habits change, and now and then
the whole system is down. No recorded home went into it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import typer
from numpy.random import Generator
from numpy.typing import NDArray

from tools.paper.homes.home import Home, merged

Touch = tuple[float, float, int]
"""When a sensor comes on and goes off, seconds since 1970, and its number."""

_ZONES = ("Europe/Berlin", "America/Chicago", "Asia/Kolkata", "Australia/Sydney")


@dataclass
class Habit:
    """Something that a person does at about the same time of day.

    Its sensors come on one after the other, some of them not every time.
    """

    hour: float
    spread: float
    """In hours."""
    on_workdays: float
    """How likely it is on a workday."""
    on_free_days: float
    later: float
    """Hours by which it is later on a free day."""
    sensors: NDArray[np.int64]
    likely: NDArray[np.float64]
    """How likely each of its sensors is to be touched."""
    gap: float
    """Seconds from one sensor to the next, in the mean."""
    dark: float
    """How much of its chance hangs on the season: -1 in summer, 1 in winter."""
    weeks: NDArray[np.float64]
    """How much more often than usual it is done in each week."""

    def times(self, day: date, rng: Generator) -> int:
        """Draw how often it is done on a day."""
        chance = self.on_free_days if day.weekday() > 4 else self.on_workdays
        year, week, _ = day.isocalendar()
        winter = np.cos(2 * np.pi * week / 52)
        chance *= self.weeks[(53 * year + week) % len(self.weeks)]
        chance *= 1 + self.dark * winter / 2
        return int(rng.binomial(3, min(1.0, chance / 3)))

    def touches(
        self, day: date, zone: ZoneInfo, lasting: NDArray[np.float64], rng: Generator
    ) -> Iterator[Touch]:
        """Yield the touches of one time that it is done."""
        later = self.later if day.weekday() > 4 else 0.0
        hour = rng.normal(self.hour + later, self.spread)
        at = _seconds(day, hour, zone)
        for sensor, likely in zip(self.sensors, self.likely, strict=True):
            if rng.random() < likely:
                yield at, at + rng.exponential(lasting[sensor]) + 1, int(sensor)
                at += rng.exponential(self.gap)


def simulated_home(seed: int) -> Home:
    """Return a home of ten to twenty weeks.

    Args:
        seed: All that is drawn follows from it.
    """
    rng = np.random.default_rng([seed, 4711])
    zone = ZoneInfo(str(rng.choice(_ZONES)))
    sensors, days = int(rng.integers(8, 25)), int(rng.integers(70, 141))
    first = date(2021, 1, 1) + timedelta(int(rng.integers(0, 365)))
    calendar = [first + timedelta(day) for day in range(days)]
    away = _stretches(days, 3, 3, 14, rng)
    touches = list(_lived(calendar, away, zone, sensors, rng))
    begin = _seconds(first, 0, zone)
    end = _seconds(calendar[-1], 24, zone)
    down = begin + 86400.0 * (_stretches(days, 3, 1, 3, rng) + 0.3)
    spans = []
    for sensor in range(sensors):
        own = np.array([t[:2] for t in touches if t[2] == sensor]).reshape(-1, 2)
        own = own[(own[:, 0] >= begin) & (own[:, 1] < end)]
        for start, stop in down:
            own = own[(own[:, 1] < start) | (own[:, 0] >= stop)]
        spans.append(merged(own))
    names = (f"s{number}" for number in range(sensors))
    return Home(tuple(names), tuple(spans), begin, end, zone.key)


def _lived(
    calendar: list[date],
    away: NDArray[np.int64],
    zone: ZoneInfo,
    sensors: int,
    rng: Generator,
) -> Iterator[Touch]:
    """Yield what the people of a home, their guests and their pet touch."""
    people = int(rng.integers(1, 4))
    used = rng.dirichlet(np.full(sensors, 0.8))
    lasting = np.exp(rng.uniform(np.log(5), np.log(1800), sensors))
    habits = [_habit(used, rng) for _ in range(people * int(rng.integers(8, 25)))]
    guests = [_habit(used, rng) for _ in range(int(rng.integers(2, 6)))]
    visits = _stretches(len(calendar), 10, 1, 5, rng)
    pet = rng.uniform(2, 15) if rng.random() < 0.4 else 0.0
    near = np.flatnonzero(rng.random(sensors) < 0.25)  # what the pet comes by
    machine = int(rng.integers(sensors))  # goes by itself, such as a heating
    goes = rng.uniform(0, 24, int(rng.integers(0, 6)))
    changes = rng.choice(len(calendar), int(rng.integers(0, 4)))
    for number, day in enumerate(calendar):
        for _ in range(int((changes == number).sum())):
            habits[rng.integers(len(habits))] = _habit(used, rng)
        home = not any(start <= number < stop for start, stop in away)
        if home:
            for habit in habits:
                for _ in range(habit.times(day, rng)):
                    yield from habit.touches(day, zone, lasting, rng)
            if any(start <= number < stop for start, stop in visits):
                for habit in guests:
                    yield from habit.touches(day, zone, lasting, rng)
        for hour in goes:
            at = _seconds(day, rng.normal(hour, 0.1), zone)
            yield at, at + rng.exponential(lasting[machine]) + 1, machine
        if home and len(near):
            for hour in rng.uniform(0, 24, rng.poisson(pet)):
                at, sensor = _seconds(day, hour, zone), int(rng.choice(near))
                yield at, at + rng.exponential(lasting[sensor]) + 1, sensor


def _habit(used: NDArray[np.float64], rng: Generator) -> Habit:
    """Draw a habit; many are for workdays, or for free days."""
    count = int(rng.integers(2, 11))
    workdays, free_days = rng.choice([(0.9, 0.9), (0.9, 0.2), (0.1, 0.7), (0.4, 0.4)])
    return Habit(
        hour=rng.uniform(6, 23),
        spread=rng.uniform(0.2, 1.5),
        on_workdays=workdays,
        on_free_days=free_days,
        later=rng.uniform(0, 2),
        sensors=rng.choice(len(used), count, p=used),
        likely=rng.uniform(0.4, 1, count),
        gap=rng.uniform(20, 400),
        dark=rng.uniform(-1, 1),
        weeks=rng.gamma(4, 0.25, 20),
    )


def _stretches(
    days: int, up_to: int, least: int, most: int, rng: Generator
) -> NDArray[np.int64]:
    """Draw less than `up_to` stretches of days: ``(n, 2)``, from and until."""
    starts = rng.integers(0, days, rng.integers(0, up_to))
    lengths = rng.integers(least, most + 1, len(starts))
    return np.column_stack([starts, starts + lengths])


def _seconds(day: date, hour: float, zone: ZoneInfo) -> float:
    """Return seconds since 1970 of an hour on the clock of a day."""
    midnight = datetime(day.year, day.month, day.day, tzinfo=zone)
    return (midnight + timedelta(hours=hour)).timestamp()


def main(folder: Path, homes: int = 20, seed: int = 0) -> None:
    """Write simulated homes into a folder, each a file that `read_home` reads.

    The first has the seed that is given, those that follow the next ones.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(seed, seed + homes):
        home = simulated_home(number)
        rows = [
            f"{on:.1f} {off - on:.1f} {sensor}"
            for sensor, spans in enumerate(home.spans)
            for on, off in spans
        ]
        path = folder / f"simulated{number:03d}.sensors"
        path.write_text("\n".join([f"# zone: {home.zone}", *rows, ""]))


if __name__ == "__main__":
    typer.run(main)
