#!/usr/bin/env python3
"""Measure how well what `neurosnap learn` tells of half a table holds in the other.

The tables are those that scikit-learn brings, and statsmodels where that is installed,
or files; and planted ones. Rows are halved at random, again for each seed. A relation
is told of the first half and looked up in the second. Then it counts how many planted
premises and lags are found, by `learn` and by a run that grows windows, and what is
told of independent sensors.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

# Run as a file, its folder is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.beyond_pairs import Beyond, Limits, beyond_pairs
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.pairs import codes_of, pair_of
from neurosnap.poc.learning.relation_rule import judge
from neurosnap.poc.learning.relation_table import Relation, tabulate
from neurosnap.sources.cuts import known_order
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.wanted import Wanted
from tests.support.planted import planted
from tests.support.watching import Watching

EXPECTED = 20
"""What never fails is missed if so many failures were to be expected by chance."""
SKLEARN = ["iris", "wine", "breast_cancer", "diabetes", "digits"]
STATSMODELS = ["anes96", "fair", "modechoice", "randhie", "star98"]
ROWS = 5000
PLANTED = ["of 0", "missed 0", "of 1", "missed 1", "of 2", "missed 2"]
PLANTED += ["of 3", "missed 3", "off", "else", "tables"]
"""Late copies (0), answers with jitter (1), premises (2 and 3); with another lag than
was planted; about other sensors; tables of which anything is told."""
Planted = tuple[int, frozenset[tuple[int, int]], int]
"""Its kind, the literals that exclude each other, 1 for off, and the lag."""
HEADS = ["told", "kept", "trivial", "never", "right", "strictly", "there", "missed"]


def shipped(folder: Path) -> Iterator[Path]:
    """Write the tables that packages bring as files; yield these."""
    for name in SKLEARN:
        found = getattr(import_module("sklearn.datasets"), f"load_{name}")(
            as_frame=True
        )
        cuts = (0, 7) if name == "digits" else (None,)
        for cut in cuts:
            frame = found.frame if cut is None else (found.data > cut).astype(int)
            file = folder / (name if cut is None else f"{name}>{cut}")
            frame.to_csv(file.with_suffix(".csv"), index=False)
            yield file.with_suffix(".csv")
    for name in STATSMODELS:
        try:
            module = import_module(f"statsmodels.datasets.{name}")
        except ImportError:
            return
        module.load_pandas().data.to_csv(folder / f"{name}.csv", index=False)
        yield folder / f"{name}.csv"


def against(row: Relation, names: dict[str, int]) -> list[tuple[int, int]]:
    """Return the pairs of literals that must not be together, by a relation."""
    a, b = 2 * names[row.a], 2 * names[row.b]
    kind = row.relation.removeprefix("nearly ")
    ends = {
        "implies": [(0, 1)],
        "never together": [(0, 0)],
        "at least one of": [(1, 1)],
        "the same": [(0, 1), (1, 0)],
        "opposite": [(0, 0), (1, 1)],
    }[kind]
    return [(a + first, b + second) for first, second in ends]


def joint(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return in how many rows each two literals are together, ``(2N, 2N)``."""
    literals = np.empty((len(table), 2 * table.shape[1]))
    literals[:, ::2], literals[:, 1::2] = table == 1, table == 0
    return literals.T @ literals


def measured(columns: Columns, known: list[tuple[int, int]], seed: int) -> Counter[str]:
    """Return how many relations of one half of the rows are what in the other."""
    sensors, names = range(len(columns.sensorium)), columns.sensorium.names
    table = np.stack(
        [np.where(columns.known(k), columns.reading(k), np.nan) for k in sensors], 1
    )
    order = np.random.default_rng(seed).permutation(len(table))
    halves = [table[np.sort(half)] for half in np.array_split(order, 2)]
    first, second = map(joint, halves)
    # Rows that are halved at random are in no order, and say nothing of lags.
    rows = tabulate(
        Columns.of(halves[0], names), every=True, known=known, limits=Limits(1, 0)
    )
    given = codes_of(known, len(sensors) * (len(sensors) - 1) // 2)
    places = {name: place for place, name in enumerate(names)}
    found, told = Counter[str](), set[tuple[int, int]]()
    for row in rows:
        pairs = against(row, places)
        if given[pair_of(*pairs[0])]:
            continue
        told |= {*pairs, *((b, a) for a, b in pairs)}
        fails = np.array([second[a, b] for a, b in pairs])
        of_a = np.array([second[a, b] + second[a, b ^ 1] for a, b in pairs])
        of_b = np.array([second[a, b] + second[a ^ 1, b] for a, b in pairs])
        worst = (fails / np.maximum(np.minimum(of_a, of_b), 1)).max()
        found["told"] += 1
        found["kept"] += worst <= row.at_most
        chance = of_a * of_b / len(halves[1])
        found["trivial"] += bool((fails >= np.maximum(chance, 1)).any())
        if row.last_failure is None:
            found["never"] += 1
            found["right"] += bool((fails <= 0.01 * (of_a + of_b - fails)).all())
            found["strictly"] += worst <= 0.01
    chance = np.outer(first.diagonal(), first.diagonal()) / len(halves[0])
    never = (first + second == 0) & (chance >= EXPECTED)
    for a, b in np.argwhere(never).tolist():
        if a >> 1 < b >> 1 and not given[pair_of(a, b)]:
            found["there"] += 1
            found["missed"] += (a, b) not in told
    return found


def held(chance: np.random.Generator, rate: float, hold: float) -> NDArray[np.bool_]:
    """Return a sensor that stays as it is with some chance from row to row."""
    last = np.where(chance.random(ROWS) >= hold, np.arange(ROWS), 0)
    taken: NDArray[np.bool_] = chance.random(ROWS) < rate
    return taken[np.maximum.accumulate(last)]


def with_premises(seed: int, flips: float) -> tuple[NDArray[np.bool_], list[Planted]]:
    """Return a table with rules of two and three premises, and what is to be told."""
    chance = np.random.default_rng(seed)
    sensors = (100, 200)[seed % 2]
    table = chance.random((ROWS, sensors)) < chance.uniform(0.4, 0.6, sensors)
    places, rules = chance.permutation(sensors).tolist(), []
    for size in 2, 3, 2, 3, 2, 3, 2, 3:
        mine = [places.pop() for _ in range(size)]
        signs, last = chance.integers(0, 2, size), places.pop()
        table[:, last] |= (table[:, mine] != signs).all(axis=1)
        literals = {*zip(mine, signs.tolist(), strict=True), (last, 1)}
        rules.append((size, frozenset(literals), 0))
    return table ^ (chance.random(table.shape) < flips), rules


def with_lags(seed: int, flips: float) -> tuple[NDArray[np.bool_], list[Planted]]:
    """Return a table with answers that come late, with jitter, and late copies."""
    chance = np.random.default_rng(seed)
    table = np.array(
        [held(chance, chance.uniform(0.05, 0.6), 0.5 * (k % 2)) for k in range(40)]
    ).T
    places, rules = chance.permutation(40).tolist(), []
    for kind in range(8):
        a, b = places.pop(), places.pop()
        lag, jitter = chance.integers(1, 16), chance.integers(0, 5) * (kind % 2)
        table[:, a] = held(chance, *((0.5, 0.95), (0.05, 0.0))[kind % 2])
        table[:, b] = False
        asked = np.flatnonzero(table[:, a])
        answered = asked + lag + chance.integers(0, jitter + 1, len(asked))
        table[answered[answered < ROWS], b] = True
        literals = frozenset(((a, 0), (b, 1)))
        rules.append((kind % 2, literals, int(lag + jitter)))
    return table ^ (chance.random(table.shape) < flips), rules


def independent(seed: int, _: float) -> tuple[NDArray[np.bool_], list[Planted]]:
    """Return a table in which nothing is to be told."""
    chance = np.random.default_rng(seed)
    rates, hold = chance.uniform(0.02, 0.98, 100), (0, 0.5, 0.9)[seed % 3]
    return np.array([held(chance, rate, hold) for rate in rates]).T, []


def report_planted(tables: int) -> None:
    """Print how much of what is planted beyond pairs is told, and what else."""
    print(f"\n{'':16}{'flips':>8}", *(f"{head:>8}" for head in PLANTED))
    for make in with_premises, with_lags, independent:
        for flips in (0.0,) if make is independent else (0.0, 0.005, 0.01, 0.02):
            found = Counter[str]()
            for seed in range(tables):
                table, rules = make(seed, flips)
                columns = Columns.of(table)
                counts = count_pairs(columns)
                codes = judge(columns, counts).codes
                given = np.zeros_like(codes)
                told, *_ = beyond_pairs(columns, counts, codes, given, Limits(3))
                found.update(held_against(sets_of(told), rules))
                found["tables"] += bool(told) or bool(codes.any())
            print(f"{make.__name__:16}{flips:8}", *(f"{found[k]:8}" for k in PLANTED))


def sets_of(told: list[Beyond]) -> dict[frozenset[tuple[int, int]], int]:
    """Return the literals of each that exclude each other, and the lag."""
    return {
        frozenset(
            (literal >> 1, literal & 1)
            for literal in (*one.premises, one.conclusion ^ 1)
        ): one.lag.ticks if one.lag else 0
        for one in told
    }


def held_against(
    sets: dict[frozenset[tuple[int, int]], int], rules: list[Planted]
) -> Iterator[str]:
    """Yield what is to be counted of what is told of a table."""
    for size, literals, lag in rules:
        yield f"of {size}"
        if literals not in sets:
            yield f"missed {size}"
        elif sets[literals] != lag:
            yield "off"
    sensors = [{sensor for sensor, _ in literals} for _, literals, _ in rules]
    for literals in sets:
        about = {sensor for sensor, _ in literals}
        if not any(about <= each for each in sensors):
            yield "else"


def report_grown(tables: int) -> None:
    """Print how much of the same a run grows, row by row, with room for 40 windows."""
    print(f"\n{'grown in a run':24}", *(f"{head:>8}" for head in PLANTED), " seconds")
    for make in with_premises, with_lags, independent:
        found, began = Counter[str](), time.process_time()
        for seed in range(tables):
            table, rules = make(seed, 0.0)
            watching = Watching(table.shape[1], 40)
            watching.show(table)
            found.update(held_against(excluded(watching), rules))
            found["tables"] += bool(watching.grown)
        took = (time.process_time() - began) / max(1, tables)
        row = (f"{found[k]:8}" for k in PLANTED)
        print(f"{make.__name__:24}", *row, f"{took:8.1f}", flush=True)


def excluded(watching: Watching) -> dict[frozenset[tuple[int, int]], int]:
    """Return what each window excludes by the order: the literals, and the lag."""
    body, graph = watching.mind.memory.body, watching.mind.snapshot.poc_graph()
    windows = {
        2 * (body.first_grown + place): window
        for place, window in enumerate(body.grown)
        if place not in body.retired
    }
    single = {a: Context(-1, (a,)) for a in range(2 * len(body.own))}
    points = {a: w for a, w in windows.items() if w.since == w.until}
    points |= {
        a + 1: w._replace(literals=(w.literals[0] ^ 1,)) for a, w in points.items()
    }
    return {
        frozenset((a >> 1, a & 1) for a in (*window.literals, *other.literals)): max(
            window.since, other.since
        )
        for place, window in windows.items()
        for above in [graph.up([place])]
        for a, other in (single | points).items()
        if above[a ^ 1] and not {*window.literals} & {*other.literals}
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--planted", type=int, default=100, help="planted tables")
    parser.add_argument("--grown", type=int, default=10, help="those of a run")
    given = parser.parse_args()
    print(f"{'':16}", *(f"{head:>8}" for head in HEADS))
    with tempfile.TemporaryDirectory() as folder:
        for file in given.files or shipped(Path(folder)):
            try:
                read = open_readings(str(file), Wanted())
            except InvalidValueError as error:
                sys.exit(str(error))
            conditions = read.wanted.every_condition()
            known = list(known_order(read.columns.sensorium.names, conditions))
            found = Counter[str]()
            for seed in range(given.seeds):
                found += measured(read.columns, known, seed)
            print(
                f"{file.stem:16}", *(f"{found[head]:8}" for head in HEADS), flush=True
            )
    found = Counter[str]()
    for seed in range(given.planted):
        noise = (0, 0.001, 0.005, 0.01, 0.02)[seed % 5]
        made = planted(seed, noise, hold=(0, 0.5)[seed // 5 % 2])
        found += measured(Columns.of(made.table), [], seed)
    print(f"{'planted':16}", *(f"{found[head]:8}" for head in HEADS))
    report_planted(given.planted)
    report_grown(given.grown)


if __name__ == "__main__":
    main()
