"""Tables of the reports of every fault-detection method for each fault."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from tools.paper.homes.faults import LONG, SEVERAL, SINGLE, affected, faulty, with_false
from tools.paper.homes.flagged_sensors import HOUR, Mention
from tools.paper.homes.health_monitor_method import SEGMENT
from tools.paper.homes.home import Home, homes_in
from tools.paper.homes.methods import HORIZON, METHODS, WEEK, Bench, bench, credited
from tools.paper.table import Entry

Rows = NDArray[np.float64]

CASES = 100
"""Faulty segments of each kind."""
KINDS = (*SINGLE, *(f"{count} at once" for count in range(2, 6)))
SEGMENT_FIELDS = (*("found", "false", "named", "right", "faulty"),)
ONSETS = 10
WEEK_FIELDS = ("found", "true", "all", "hours")
FALSE_EVENTS = 50
_LATEST = 0.75


def segments(bench: Bench, seed: int) -> Rows:
    """Return what is said of faulty segments.

    Returns:
        ``(kinds, cases, methods, fields)``, see `KINDS`, `METHODS`, `SEGMENT_FIELDS`;
        not a number where there is no case.
    """
    made = np.full((len(KINDS), CASES, len(METHODS), len(SEGMENT_FIELDS)), np.nan)
    if not len(bench.segments) or len(bench.known) < 2:
        return made
    twins: dict[tuple[str, float], list[Mention]] = {}
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng([seed, number])
        for case in range(min(CASES, len(bench.segments))):
            begin = float(rng.choice(bench.segments))
            end = begin + SEGMENT
            onset = float(rng.uniform(begin, begin + _LATEST * SEGMENT))
            broken = _broken(bench, kind, onset, end, rng)
            who = set(affected(bench.home, broken))
            for place, name in enumerate(METHODS):
                method = bench.method(name, begin)
                if (name, begin) not in twins:
                    twins[name, begin] = method.mentions(bench.home, begin, end)
                made[number, case, place] = _judged(
                    method.mentions(broken, begin, end) if who else [],
                    twins[name, begin],
                    who,
                    begin,
                    onset,
                )
    return made


def _broken(bench: Bench, kind: str, onset: float, end: float, rng: Generator) -> Home:
    if kind in SINGLE:
        sensor = int(rng.choice(bench.known))
        return faulty(bench.home, kind, sensor, onset, end, rng)
    count = min(int(kind.split()[0]), len(bench.known))
    home = bench.home
    for each in rng.choice(bench.known, count, replace=False):
        home = faulty(home, str(rng.choice(SEVERAL)), int(each), onset, end, rng)
    return home


def _judged(
    found: list[Mention],
    twin: list[Mention],
    who: set[int],
    begin: float,
    onset: float,
) -> list[float]:
    """Return the fields of a case; `who` is who has a visible fault."""
    new = credited(found, twin, onset)
    named = {mention.sensor for mention in new}
    return [
        float(bool(new)),
        float(any(mention.begin > begin for mention in twin)),
        float(len(named)),
        float(len(named & who)),
        float(len(who)),
    ]


def long_faults(bench: Bench, seed: int) -> Rows:
    """Return after how many hours long faults are found.

    Returns:
        ``(kinds, known sensors, onsets, methods)``, hours; infinite: not within four
        weeks, or to the end of the home.
    """
    made = np.full((len(LONG), len(bench.known), ONSETS, len(METHODS)), np.inf)
    early = bench.segments[: int(_LATEST * len(bench.segments))]
    if not len(early):
        return made[:, :0]
    for number, kind in enumerate(LONG):
        rng = np.random.default_rng([seed, 100 + number])
        for onset in range(ONSETS):
            begin = float(rng.choice(early))
            end = min(begin + HORIZON, bench.home.end)
            for place, sensor in enumerate(bench.known):
                broken = faulty(bench.home, kind, int(sensor), begin, end + 1, rng)
                for at, name in enumerate(METHODS):
                    method = bench.method(name, begin)
                    seen = method.since(broken, int(sensor), begin, end)
                    if seen is not None:
                        made[number, place, onset, at] = (seen - begin) / HOUR
    return made


def clean_days(bench: Bench, _: int) -> Rows:
    """Return how many alarms begin on each day without faults, ``(methods, days)``."""
    days = int((bench.home.end - bench.start) // 86400)
    made = np.zeros((len(METHODS), days))
    for place, name in enumerate(METHODS):
        for mention in bench.clean(name):
            day = int((mention.begin - bench.start) // 86400)
            if day < days:
                made[place, day] += 1
    return made


def last_week(bench: Bench, seed: int) -> Rows:
    """Return what is said of false and removed activations in a week.

    Learned from all before, three weeks at most of them in the tables of the others.

    Returns:
        ``(2, sensors, methods, fields)``: false ones, removed ones; see `WEEK_FIELDS`.
        The sensors are those known then; others are not a number.
    """
    made = np.full((2, len(bench.home.sensors), len(METHODS), len(WEEK_FIELDS)), np.nan)
    fit = bench.segments[bench.segments <= bench.home.end - WEEK]
    if not len(fit):
        return made
    begin = float(fit[-1])
    end = begin + WEEK
    rng = np.random.default_rng([seed, 200])
    twins = {
        name: bench.method(name, begin).mentions(bench.home, begin, end)
        for name in METHODS
    }
    for sensor in bench.known:
        own = bench.home.spans[sensor]
        removed = own[(own[:, 0] < begin) | (own[:, 0] >= end)]
        versions = (with_false(own, FALSE_EVENTS, begin, end, rng), removed)
        for kind, spans in enumerate(versions):
            if len(spans) == len(own):
                continue
            broken = bench.home.with_spans({int(sensor): spans})
            for at, name in enumerate(METHODS):
                found = bench.method(name, begin).mentions(broken, begin, end)
                mine = [m for m in found if m.sensor == sensor and m.begin > begin]
                new = credited(mine, twins[name], begin)
                made[kind, sensor, at] = [
                    float(bool(new)),
                    len(new),
                    len(mine),
                    (new[0].begin - begin) / HOUR if new else np.nan,
                ]
    return made


_TABLES: dict[str, Callable[[Bench, int], Rows]] = {
    "segments": segments,
    "long": long_faults,
    "week": last_week,
    "clean": clean_days,
}


class HomeEntry(Entry, frozen=True, kw_only=True):
    """The reports of every method for one home; each run draws its cases by a seed."""

    VERSION = 5

    table: str
    """One of `_TABLES`."""
    home: str
    """The name of its file."""
    digest: str
    """SHA-256 of the file."""
    alarms: str
    """The budget of the health monitor."""
    path: str
    """Where the file is; no part of the key."""

    @property
    def key(self) -> str:
        """All that its rows depend on, as JSON."""
        return super(HomeEntry, msgspec.structs.replace(self, path="")).key

    def row(self, run: int) -> Rows:
        """Return what came of one seed; what there is no case for is not a number."""
        return _TABLES[self.table](bench(self.path, self.alarms), self.seed + run)


def entries(folder: Path, alarms: str, runs: int, seed: int) -> list[HomeEntry]:
    """Return the entries of all homes in a folder, by home and table."""
    made = []
    for path in homes_in(folder):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        made += [
            HomeEntry(
                table=table,
                home=path.stem,
                digest=digest,
                alarms=alarms,
                runs=1 if table == "clean" else runs,
                seed=seed,
                path=str(path),
            )
            for table in _TABLES
        ]
    return made
