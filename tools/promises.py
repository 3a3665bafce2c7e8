#!/usr/bin/env python3
"""Measure how well what `neurosnap learn` tells of half a table holds in the other.

The tables are those that scikit-learn brings, and statsmodels where that is installed,
or files; and planted ones. Rows are halved at random, again for each seed. A relation
is told of the first half and looked up in the second. Then it counts how many planted
premises and lags are found, by `learn` and by a run that grows windows, what is told
of independent sensors, how often the search for premises goes on from a parity, and how
soon a flipped bit of a row is named.
"""

import argparse
import math
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

# Run as a file, its folder is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.beyond_pairs import Limits, beyond_pairs
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.odd_reading import oddness
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.pairs import codes_of, pair_of
from neurosnap.poc.learning.premises import _EASIER, _odd_sets, _pairs
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.learning.relation_rule import WORK, evidence_for, judge
from neurosnap.poc.learning.relation_table import Relation, tabulate
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.sensorium import Sensorium, selection
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
BEYOND = ["of 0", "missed 0", "of 1", "missed 1", "of 2", "missed 2"]
BEYOND += ["of 3", "missed 3", "off", "else", "tables", "ms each"]
"""Late copies (0), answers with jitter (1), premises (2 and 3); with another lag than
was planted; about other sensors; tables of which anything is told."""
Rule = tuple[int, frozenset[int], int]
"""Its kind, the literals that exclude each other, and the lag."""
Made = tuple[NDArray[np.bool_], list[Rule]]
Maker = Callable[[int, float], Made]
Sets = dict[frozenset[int], int]
Tell = Callable[[NDArray[np.bool_]], tuple[Sets, bool]]
HEADS = ["told", "kept", "trivial", "never", "right", "strictly", "there", "missed"]


def shipped(folder: Path) -> Iterator[Path]:
    """Write the tables that packages bring as files; yield these."""
    for name in SKLEARN:
        load = getattr(import_module("sklearn.datasets"), f"load_{name}")
        found = load(as_frame=True)
        for cut in (0, 7) if name == "digits" else (None,):
            frame = found.frame if cut is None else (found.data > cut).astype(int)
            file = folder / (f"{name}.csv" if cut is None else f"{name}>{cut}.csv")
            frame.to_csv(file, index=False)
            yield file
    for name in STATSMODELS if find_spec("statsmodels") else ():
        module = import_module(f"statsmodels.datasets.{name}")
        module.load_pandas().data.to_csv(folder / f"{name}.csv", index=False)
        yield folder / f"{name}.csv"


def against(row: Relation, sensors: Sensorium) -> list[tuple[int, int]]:
    """Return the pairs of literals that must not be together, by a relation."""
    a, b = sensors.literal(row.a), sensors.literal(row.b)
    ends = {
        "implies": [(0, 1)],
        "never together": [(0, 0)],
        "at least one of": [(1, 1)],
        "the same": [(0, 1), (1, 0)],
        "opposite": [(0, 0), (1, 1)],
    }[row.relation.removeprefix("nearly ")]
    return [(a + first, b + second) for first, second in ends]


def joint(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return in how many rows each two literals are together, ``(2N, 2N)``."""
    literals = np.stack([table == 1, table == 0], 2).reshape(len(table), -1) * 1.0
    return literals.T @ literals


def measured(columns: Columns, known: list[tuple[int, int]], seed: int) -> Counter[str]:
    """Return how many relations of one half of the rows are what in the other."""
    sensors = range(len(columns.sensorium))
    reads = [np.where(columns.known(k), columns.reading(k), np.nan) for k in sensors]
    table = np.stack(reads, axis=1)
    order = np.random.default_rng(seed).permutation(len(table))
    halves = [table[np.sort(half)] for half in np.array_split(order, 2)]
    first, second = map(joint, halves)
    # Rows that are halved at random are in no order, and say nothing of lags.
    half, limits = Columns.of(halves[0], columns.sensorium.names), Limits(1, 0)
    rows = tabulate(half, every=True, known=known, limits=limits)
    given = codes_of(known, len(sensors) * (len(sensors) - 1) // 2)
    found, told = Counter[str](), set[tuple[int, int]]()
    for row in rows:
        pairs = against(row, columns.sensorium)
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


def with_premises(seed: int, flips: float) -> Made:
    """Return a table with rules of two and three premises, and what is to be told."""
    chance = np.random.default_rng(seed)
    sensors = (100, 200)[seed % 2]
    table = chance.random((ROWS, sensors)) < chance.uniform(0.4, 0.6, sensors)
    places, rules = chance.permutation(sensors).tolist(), []
    for size in 2, 3, 2, 3, 2, 3, 2, 3:
        mine = [places.pop() for _ in range(size)]
        signs, last = chance.integers(0, 2, size), places.pop()
        table[:, last] |= (table[:, mine] != signs).all(axis=1)
        literals = frozenset((2 * np.array(mine) + signs).tolist())
        rules.append((size, literals | {2 * last + 1}, 0))
    return table ^ (chance.random(table.shape) < flips), rules


def with_lags(seed: int, flips: float) -> Made:
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
        rules.append((kind % 2, frozenset((2 * a, 2 * b + 1)), int(lag + jitter)))
    return table ^ (chance.random(table.shape) < flips), rules


def independent(seed: int, _: float) -> Made:
    """Return a table in which nothing is to be told."""
    chance = np.random.default_rng(seed)
    rates, hold = chance.uniform(0.02, 0.98, 100), (0, 0.5, 0.9)[seed % 3]
    return np.array([held(chance, rate, hold) for rate in rates]).T, []


def with_parity(seed: int, flips: float) -> Made:
    """Return a table whose last sensor is the parity of two, where not flipped."""
    chance = np.random.default_rng(seed)
    table = chance.random((ROWS, 13)) < 0.5
    a, b = chance.permutation(12)[:2].tolist()
    table[:, 12] = table[:, a] ^ table[:, b] ^ (chance.random(ROWS) < flips)
    never = (0, 0, 24), (0, 1, 25), (1, 0, 25), (1, 1, 24)
    return table, [(2, frozenset((2 * a + x, 2 * b + y, z)), 0) for x, y, z in never]


def say(name: str, cells: Iterable[object]) -> None:
    print(name, *(f"{cell:>8}" for cell in cells), flush=True)


def report(tell: Tell, makers: list[Maker], tables: int, flips: list[float]) -> None:
    """Print how much of what is planted beyond pairs is told, and what else."""
    say(f"\n{tell.__name__:16}{'flips':>8}", BEYOND)
    for make in makers:
        for share in flips if make is not independent else [0.0]:
            found, began = Counter[str](), time.process_time()
            for seed in range(tables):
                table, rules = make(seed, share)
                told, anything = tell(table)
                found.update(held_against(told, rules))
                found["tables"] += anything
            found["ms each"] = int(1e3 * (time.process_time() - began) / (tables or 1))
            say(f"{make.__name__:16}{share:8}", (found[head] for head in BEYOND))


def told_of(table: NDArray[np.bool_]) -> tuple[Sets, bool]:
    """Return what `learn` tells beyond pairs, and whether it tells anything."""
    columns = Columns.of(table)
    counts = count_pairs(columns)
    codes = judge(columns, counts).codes
    told, *_ = beyond_pairs(columns, counts, codes, np.zeros_like(codes), Limits(3))
    sets = [frozenset((*one.premises, one.conclusion ^ 1)) for one in told]
    lags = [one.lag.ticks if one.lag else 0 for one in told]
    return dict(zip(sets, lags, strict=True)), bool(told) or bool(codes.any())


def gone_on_from(table: NDArray[np.bool_]) -> tuple[Sets, bool]:
    """Return the sets of three from which the search for three premises goes on."""
    columns = Columns.of(table)
    needed = evidence_for(8 * math.comb(table.shape[1], 3)) / _EASIER
    odd = _odd_sets(columns, _pairs(columns, WORK)[0], 3, needed).literals.tolist()
    return dict.fromkeys(map(frozenset, odd), 0), bool(odd)


def grown(table: NDArray[np.bool_]) -> tuple[Sets, bool]:
    """Return what a run grows row by row, with room for 40 windows."""
    watching = Watching(table.shape[1], 40)
    watching.show(table)
    return excluded(watching), bool(watching.grown)


def held_against(sets: Sets, rules: list[Rule]) -> Iterator[str]:
    """Yield what is to be counted of what is told of a table."""
    for size, literals, lag in rules:
        yield f"of {size}"
        if literals not in sets:
            yield f"missed {size}"
        elif sets[literals] != lag:
            yield "off"
    either = [{*literals, *(a ^ 1 for a in literals)} for _, literals, _ in rules]
    for literals in sets:
        if not any(literals <= each for each in either):
            yield "else"


def excluded(watching: Watching) -> Sets:
    """Return what each window excludes by the order: the literals, and the lag."""
    body, graph = watching.mind.memory.body, watching.mind.snapshot.poc_graph()
    born = enumerate(body.grown)
    windows = {
        2 * (body.first_grown + k): one for k, one in born if k not in body.retired
    }
    single = {a: Context(-1, (a,)) for a in range(2 * len(body.own))}
    points = {a: w for a, w in windows.items() if w.since == w.until}
    points |= {
        a + 1: w._replace(literals=(w.literals[0] ^ 1,)) for a, w in points.items()
    }
    return {
        frozenset((*window.literals, *other.literals)): max(window.since, other.since)
        for place, window in windows.items()
        for above in [graph.up([place])]
        for a, other in (single | points).items()
        if above[a ^ 1] and not {*window.literals} & {*other.literals}
    }


def fitted(good: NDArray[np.bool_], new: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return by how much each reading misses a logistic regression on all others."""
    regression = import_module("sklearn.linear_model").LogisticRegression
    missed = np.zeros(new.shape)
    for k, own in enumerate(good.T):
        likely = own.mean()
        if 0 < likely < 1:
            made = regression(max_iter=1000).fit(np.delete(good, k, axis=1), own)
            likely = made.predict_proba(np.delete(new, k, axis=1))[:, 1]
        missed[:, k] = np.abs(likely - new[:, k])
    return missed


def named(
    good: NDArray[np.bool_], new: NDArray[np.bool_], flipped: NDArray[np.int64]
) -> Iterator[tuple[int, ...]]:
    """Yield the rank of each row's flipped bit as a run names it, 0 if it says nothing.

    Then those by how odd each reading is, and by a logistic regression. A run has
    learned other rows; what it does not name comes after what it names, by oddness.
    """
    sensors = np.arange(new.shape[1])
    snapshot, history = EmpiricalSnapshot(len(sensors), "auto"), History(64, 8192)
    detector = AnomalyDetector(len(sensors), support=10)
    for bits in good:
        detector.watch(history.tick, PocGraph.from_implications(64, []), bits)
        snapshot.learn(bits)
        history.record(bits)
    graph, missed = snapshot.poc_graph(), fitted(good, new)
    for row, (bits, at) in enumerate(zip(new, flipped.tolist(), strict=True)):
        odd = oddness(history, sensors, selection(bits, None))
        ranks = [int((each > each[at]).sum()) + 1 for each in (odd, missed[row])]
        told = detector.watch(10_000 * (row + 1), graph, bits)
        names = [*told.culprits, *told.candidates] if told else []
        names = [*dict.fromkeys([*names, *np.argsort(-odd).tolist()])]
        yield told is not None and names.index(at) + 1, *ranks


def report_flipped(seeds: int) -> None:
    """Print how soon one flipped bit of a row of digits is named, of 64."""
    heads = [
        "rows",
        "broken",
        "first",
        "rank",
        "odd",
        "logistic",
        "all: odd",
        "logistic",
    ]
    say(f"\n{'a flipped bit':16}", heads)
    table = import_module("sklearn.datasets").load_digits().data
    for cut in 0, 7:
        found = list[tuple[int, ...]]()
        for seed in range(seeds):
            chance = np.random.default_rng(seed)
            good, new = np.array_split(chance.permutation(table > cut), 2)
            flipped = chance.integers(0, new.shape[1], len(new))
            new[np.arange(len(new)), flipped] ^= True
            found += named(good, new, flipped)
        every = np.array(found)
        there = every[every[:, 0] > 0]
        means = (f"{each:.2f}" for each in (*there.mean(0), *every[:, 1:].mean(0)))
        first = (there[:, 0] == 1).sum()
        say(f"{f'digits>{cut}':16}", [len(every), len(there), first, *means])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--planted", type=int, default=100, help="planted tables")
    parser.add_argument("--grown", type=int, default=10, help="those of a run")
    given = parser.parse_args()
    say(f"{'':16}", HEADS)
    with tempfile.TemporaryDirectory() as folder:
        for file in given.files or shipped(Path(folder)):
            try:
                read = open_readings(str(file), Wanted())
            except InvalidValueError as error:
                sys.exit(str(error))
            conditions = read.wanted.every_condition()
            known = list(known_order(read.columns.sensorium.names, conditions))
            each = (measured(read.columns, known, k) for k in range(given.seeds))
            found = sum(each, Counter[str]())
            say(f"{file.stem:16}", (found[head] for head in HEADS))
    found = Counter[str]()
    for seed in range(given.planted):
        noise = (0, 0.001, 0.005, 0.01, 0.02)[seed % 5]
        made = planted(seed, noise, hold=(0, 0.5)[seed // 5 % 2])
        found += measured(Columns.of(made.table), [], seed)
    say(f"{'planted':16}", (found[head] for head in HEADS))
    report_flipped(given.seeds)
    makers: list[Maker] = [with_premises, with_lags, independent]
    report(told_of, makers, given.planted, [0.0, 0.005, 0.01, 0.02])
    report(gone_on_from, [with_parity], given.planted, [0.4])
    report(grown, makers, given.grown, [0.0])


if __name__ == "__main__":
    main()
