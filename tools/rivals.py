#!/usr/bin/env python3
"""Measure common outlier detectors on a table with labels, at an alarm a month.

    neurosnap watch a.mcap --format json | tools/rivals.py clean.csv labelled.csv

Each learns the first table, in which nothing is wrong. What score is an alarm is set on
it, too: each of twelve parts is scored by what learned the other eleven. Rows are an
hour each. Standard input has what is told of a run of both, one after the other.
"""

import csv
import json
import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.ensemble import IsolationForest
from sklearn.neural_network import MLPRegressor

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
LABEL, MONTH = "ATT_FLAG", 730.5
HEADS = "", "alarms a month, clean", "outside", "F1", "found", "rows to the first"


def table(path: str) -> tuple[Floats, Bools]:
    """Return the numbers of a table, without its first column, and what is wrong."""
    lines = Path(path).read_text("utf-8").splitlines()
    head, *rows = ([cell.strip() for cell in row] for row in csv.reader(lines) if row)
    if LABEL not in head:
        raise SystemExit(f"{path}: must have a column {LABEL}, got {', '.join(head)}")
    values = np.array([[float(cell) for cell in row[1:]] for row in rows])
    place = head.index(LABEL) - 1
    return np.delete(values, place, axis=1), values[:, place] == 1


def pca(rows: Floats, others: Floats) -> Floats:
    model = PCA(0.9).fit(rows)
    back = model.inverse_transform(model.transform(others))
    return np.asarray(((back - others) ** 2).mean(1))


def autoencoder(rows: Floats, others: Floats) -> Floats:
    shape = {"hidden_layer_sizes": (32, 8, 32), "max_iter": 400}
    model = MLPRegressor(**shape, early_stopping=True, random_state=0).fit(rows, rows)
    return np.asarray(((model.predict(others) - others) ** 2).mean(1))


def isolation_forest(rows: Floats, others: Floats) -> Floats:
    model = IsolationForest(n_estimators=200, random_state=0).fit(rows)
    return np.asarray(-model.score_samples(others))


def ecod(rows: Floats, others: Floats) -> Floats:
    model: Any = import_module("pyod.models.ecod").ECOD().fit(rows)
    return np.asarray(model.decision_function(others))


def alarms(over: Bools) -> int:
    """Return how many alarms there are; 24 rows without end one."""
    return int((np.diff(np.flatnonzero(over), prepend=-25) > 24).sum())


def judge(name: str, over: Bools, true: Bools) -> None:
    """Print the row of a method, by which rows of both tables it flags."""
    clean, over = np.split(over, [len(over) - len(true)])
    edges = np.flatnonzero(np.diff(np.r_[False, true, False])).reshape(-1, 2)
    first = [int(over[a:b].argmax()) for a, b in edges if over[a:b].any()]
    monthly = [f"{alarms(of) * MONTH / len(of):.2g}" for of in (clean, over[~true])]
    f1 = 2 * (over & true).sum() / (over.sum() + true.sum())
    found = f"{len(first)} of {len(edges)}", ", ".join(map(str, first))
    print("|", " | ".join((name, *monthly, f"{f1:.2f}", *found)), "|", flush=True)


def main(clean: Floats, rows: Floats, true: Bools) -> None:
    """Judge all methods."""
    print("|", " | ".join(HEADS), "|\n" + "|---" * len(HEADS) + "|")
    if not sys.stdin.isatty() and (lines := sys.stdin.readlines()):
        ticks = [each["tick"] for each in map(json.loads, lines) if "culprits" in each]
        told = np.isin(np.arange(len(clean) + len(rows)) + 1, ticks)
        judge("anomalies", told, true)
    mean, scale, count = clean.mean(0), clean.std(0) + 1e-9, len(clean)
    clean, rows = (clean - mean) / scale, (rows - mean) / scale
    parts = np.array_split(np.arange(count), 12)
    for method in (pca, autoencoder, isolation_forest, ecod):
        try:
            left = [method(np.delete(clean, part, 0), clean[part]) for part in parts]
        except ImportError:
            print(f"| {method.__name__}: not installed |" + " |" * (len(HEADS) - 1))
            continue
        score = np.concatenate([*left, method(clean, rows)])
        for span in (1, 6, 24):  # rows of which the mean counts
            row = np.convolve(score, np.ones(span))[: len(score)]
            levels = np.sort(row[:count])[::-1]
            kept = [alarms(row[:count] > lv) <= count / MONTH for lv in levels]
            level = levels[[*kept, False].index(False) - 1]
            judge(f"{method.__name__}, {span} h", row > level, true)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(table(sys.argv[1])[0], *table(sys.argv[2]))
